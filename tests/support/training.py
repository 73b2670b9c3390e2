"""Small trainings of the humanoid's walk."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.runs.plan import make_plan
from actuated_characters.training import training
from actuated_characters.training.references import TrainedReference
from actuated_characters.training.training import Job
from controller_node.parameters import make_controller_settings
from controller_node.planner.settings import make_planner_settings
from controller_node.tracked_reference import TrackedReference
from msgs_config.clips.reading import read_clip
from msgs_config.messages.clock import TickClock
from tests.support.physics import character

HUMANOID = character("humanoid")
SMALL = {"_WORLDS": 8, "_DECISIONS": 4, "_LOOKS": 2, "_LOOK_WORLDS": 2, "_LOOK_S": 0.2}
DECISIONS = SMALL["_WORLDS"] * SMALL["_DECISIONS"]


def walking_job(**given: object) -> Job:
    """A job of the walk; `given` are fields that are another."""
    clip = {"reference": "clip", "clip": "walk"}
    plan = make_plan("humanoid", 1.0, clip, {}, {"planner": "predictive", "plan.workers": 1})
    frames = read_clip(HUMANOID, "walk")
    clock = TickClock(plan.simulation.rate_hz)
    tracked = TrackedReference(plan.character, plan.reference, clock, episode_ns=0)
    job = Job(
        HUMANOID,
        [TrainedReference(tracked, float(frames.times[-1]), frames.wraps)],
        ("walk",),
        make_planner_settings(HUMANOID, plan.controller),
        make_controller_settings(HUMANOID, plan.controller).gains,
        decisions=3 * DECISIONS,
        most_push=20.0,
        seed=1,
        threads=1,
    )
    return replace(job, **given)  # type: ignore[arg-type]


def make_small(patch: pytest.MonkeyPatch, **constants: object) -> None:
    """Have trainings make a few decisions at once."""
    for name, value in {**SMALL, **constants}.items():
        patch.setattr(training, name, value)


def arrays_of(policy: object) -> Mapping[str, np.ndarray]:
    """A policy's networks, by name."""
    networks = {"policy": policy.network, "value": policy.value}  # type: ignore[attr-defined]
    return {
        f"{name}.{field}": array
        for name, network in networks.items()
        for field, array in network._asdict().items()
    }
