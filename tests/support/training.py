"""Small trainings of the humanoid's walk."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.training import training
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.job import Job, make_job
from tests.support.physics import character

HUMANOID = character("humanoid")
SMALL = {"_WORLDS": 8, "_DECISIONS": 4, "_LOOKS": 2, "_LOOK_WORLDS": 2, "_LOOK_S": 0.2}
DECISIONS = SMALL["_WORLDS"] * SMALL["_DECISIONS"]


def walking_job(**given: object) -> Job:
    """A job of the walk; `given` are fields that are another."""
    walk = Exercise("humanoid", "walk")
    job = make_job([walk], {}, decisions=3 * DECISIONS, most_push=20.0, seed=1)
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
