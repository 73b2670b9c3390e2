"""Dropped ragdolls lose energy, come to rest, and bend little more than their joints can."""

from dataclasses import dataclass

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.behaviours.base import Mode
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Joint
from tests.support.physics import (
    LoneSimulation,
    character,
    controller,
    link_motions,
    random_rotation_vector,
    simulation,
    touches,
)

pytestmark = pytest.mark.usefixtures("engine")

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
RATE_HZ, SECONDS = 240, 5
GRAVITY = 9.81
MOST_ENERGY = 1.05  # of what there was
RESTING = 0.1  # J
STILL, LYING = 0.01, 0.5  # J, and s in which it has no more: nothing moves any more
EVERY = 8  # ticks; that the engine is asked for its numbers takes longer than a step
TO_THE_END = range(5)
EXTREME = (9, 18, 41, 45, 58, 62, 67, 71, 75, 85, 87)  # of 100: farthest, longest, most energy
SEEDS = sorted({*range(20), *EXTREME})
TWITCH, LASTING_EXCESS = 40.0, 4.0  # degrees beyond a limit, in a blow and lying
FAR, LONGEST = 10.0, 0.2  # degrees beyond a limit, and s of all blows together in which it is


@dataclass(frozen=True)
class Drop:
    """What a drop came to."""

    most_energy: float  # of the first one
    kinetic: float  # J, at the end
    most_excess: float  # degrees beyond a limit, at any time
    last_excess: float  # degrees, at the end
    far: float  # s in which it was far beyond a limit


def pose_within_limits(rng: np.random.Generator) -> FloatArray:
    """A position (n,) high in the air, every joint within its limits."""
    position = np.zeros(LAYOUT.size)
    for joint in HUMANOID.moving_joints:
        entries = LAYOUT.joint(joint.name).entries
        if joint.soft_limit is not None:
            position[entries] = rng.uniform(joint.soft_limit.lower, joint.soft_limit.upper)
        elif joint.type is JointType.REVOLUTE:
            position[entries] = rng.uniform(joint.lower, joint.upper)
    position[3:6] = random_rotation_vector(rng)
    position[2] = 5.0
    return position


def dropped(run: LoneSimulation, rng: np.random.Generator) -> None:
    """Put it 0.3 to 1.5 m above the ground at up to 2 m/s and 3 rad/s, touching nothing."""
    body, still = run.simulated._body, np.zeros(LAYOUT.size)
    for _ in range(200):
        position = pose_within_limits(rng)
        body.set_state(position, still)
        if not touches(body):
            break
    else:
        raise AssertionError("no pose without contact was found")
    lowest = min(float(motion.centre[2]) for motion in link_motions(body, HUMANOID))
    position[2] += rng.uniform(0.3, 1.5) + 0.1 - lowest  # a link's radius is 0.1 m or less
    velocity = rng.uniform(-3.0, 3.0, LAYOUT.size)
    direction = rng.normal(size=3)
    velocity[:3] = rng.uniform(0.0, 2.0) * direction / np.linalg.norm(direction)
    body.set_state(position, velocity)


def energies(run: LoneSimulation) -> tuple[float, float]:
    """Kinetic and all energy by the engine's numbers, J; the ground is the zero level."""
    motions = link_motions(run.simulated._body, HUMANOID)
    kinetic = sum(motion.kinetic_energy for motion in motions)
    height = sum(motion.mass * GRAVITY * float(motion.centre[2]) for motion in motions)
    return kinetic, kinetic + height


def excess(positions: FloatArray) -> FloatArray:
    """How far the worst joint is beyond its limits in each position (ticks, n): (ticks,) degrees.

    Of a whole drop at once: tick by tick it would take as long as the simulation.
    """
    worst = [_excess(joint, positions) for joint in HUMANOID.moving_joints]
    return np.degrees(np.max(worst, axis=0))


def _excess(joint: Joint, positions: FloatArray) -> FloatArray:
    turns = positions[:, LAYOUT.joint(joint.name).entries]
    if joint.type is JointType.REVOLUTE:
        return np.maximum(np.maximum(joint.lower - turns, turns - joint.upper), 0.0)[:, 0]
    if joint.soft_limit is None:
        return np.zeros(len(turns))
    angles = np.linalg.norm(turns, axis=1, keepdims=True)
    ways = [turns, turns - turns * (2.0 * np.pi / np.maximum(angles, 1e-9))]
    lower, upper = np.array(joint.soft_limit.lower), np.array(joint.soft_limit.upper)
    beyond = [np.linalg.norm(way - np.clip(way, lower, upper), axis=1) for way in ways]
    return np.minimum(*beyond)


def drop(seed: int, *, to_the_end: bool) -> Drop:
    """Drop it; without `to_the_end` it is over when it has been lying still."""
    with simulation("humanoid") as run:
        dropped(run, np.random.default_rng(seed))
        kinetic, first = energies(run)
        nothing, positions, most, still = np.zeros(LAYOUT.size), [], 0.0, 0
        for tick in range(SECONDS * RATE_HZ):
            positions.append(run.advance(nothing).position)
            if tick % EVERY == EVERY - 1:
                kinetic, whole = energies(run)
                most = max(most, whole)
                still = still + EVERY if kinetic < STILL else 0
            if still >= LYING * RATE_HZ and not to_the_end:
                break
    beyond = excess(np.array(positions))
    far = int(np.count_nonzero(beyond > FAR)) / RATE_HZ
    return Drop(most / first, kinetic, float(beyond.max()), float(beyond[-1]), far)


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(seed, marks=[] if seed in (0, *EXTREME) else pytest.mark.nightly)
        for seed in SEEDS
    ],
)
def test_a_dropped_ragdoll_gains_no_energy_and_comes_to_rest_within_its_limits(seed: int) -> None:
    end = drop(seed, to_the_end=seed in TO_THE_END)

    assert end.most_energy < MOST_ENERGY
    assert end.kinetic < RESTING
    assert end.most_excess < TWITCH
    assert end.last_excess < LASTING_EXCESS
    assert end.far < LONGEST


def test_as_a_behaviour_it_has_no_effort_and_falls() -> None:
    given = {"reference": "clip", "clip": "walk"}
    own = {"behaviour": "ragdoll", "law": "computed_torque", "balance.enabled": True}
    plan = make_plan("humanoid", 1.0, given, {}, own)

    ticks = list(ticks_in_process(plan))

    # that it has no effort although a law and balance are given
    assert "root" not in plan.simulator["commanded_joints"]
    assert all(not np.any(tick.following.effort) for tick in ticks)
    assert ticks[-1].following.position[2] < 0.5
    driver = controller("humanoid", behaviour="ragdoll")
    driver.compute_effort(ticks[0].state, ticks[0].state.stamp_ns)
    assert driver.mode is not None and driver.mode.phase.mode is Mode.LIMP


def test_its_law_cannot_be_changed_while_it_runs() -> None:
    from controller_node.parameters import make_controller_settings, resolve_for

    values = resolve_for(HUMANOID, {"behaviour": "ragdoll", "law": "pd"})

    assert make_controller_settings(HUMANOID, values).law == "zero"
