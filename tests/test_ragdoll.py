"""Dropped ragdolls lose energy, come to rest, and bend little more than their joints can."""

from dataclasses import dataclass

import numpy as np
import pytest
from physics import (
    LoneSimulation,
    character,
    controller,
    kinetic_energy,
    link_motions,
    random_rotation_vector,
    simulation,
    touches,
)

from controller_node.behaviours.base import Mode
from experiment.loop import ticks_in_process
from experiment.plan import make_plan
from msgs_config.arrays import FloatArray
from msgs_config.character import Joint
from msgs_config.joint_layout import JointType

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
RATE_HZ, SECONDS = 240, 5
GRAVITY = 9.81
MOST_ENERGY = 1.05  # of what there was
RESTING = 0.1  # J
DROPS, BATCH = 100, 5
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
    body, still = run.actor._body, np.zeros(LAYOUT.size)
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


def energy(run: LoneSimulation) -> float:
    """Kinetic and potential energy by the engine's numbers, J; the ground is the zero level."""
    height = sum(
        motion.mass * GRAVITY * float(motion.centre[2])
        for motion in link_motions(run.actor._body, HUMANOID)
    )
    return kinetic_energy(run.actor._body, HUMANOID) + height


def excess(position: FloatArray) -> float:
    """How far the worst joint is beyond its limits, degrees."""
    return float(np.degrees(max(_excess(joint, position) for joint in HUMANOID.moving_joints)))


def _excess(joint: Joint, position: FloatArray) -> float:
    turn = position[LAYOUT.joint(joint.name).entries]
    if joint.type is JointType.REVOLUTE:
        return float(max(joint.lower - turn[0], turn[0] - joint.upper, 0.0))
    if joint.soft_limit is None:
        return 0.0
    angle = float(np.linalg.norm(turn))
    ways = [turn, turn - turn * (2.0 * np.pi / max(angle, 1e-9))]
    lower, upper = np.array(joint.soft_limit.lower), np.array(joint.soft_limit.upper)
    return float(min(np.linalg.norm(way - np.clip(way, lower, upper)) for way in ways))


def drop(seed: int) -> Drop:
    with simulation("humanoid") as run:
        dropped(run, np.random.default_rng(seed))
        first, most, twitch, far = energy(run), 0.0, 0.0, 0
        nothing = np.zeros(LAYOUT.size)
        for tick in range(SECONDS * RATE_HZ):
            run.advance(nothing)
            beyond = excess(run.state.position)
            twitch, far = max(twitch, beyond), far + (beyond > FAR)
            if tick % 8 == 0:  # that the engine is asked for its numbers takes longer than a step
                most = max(most, energy(run))
        kinetic = kinetic_energy(run.actor._body, HUMANOID)
        return Drop(most / first, kinetic, twitch, excess(run.state.position), far / RATE_HZ)


@pytest.mark.parametrize("batch", range(DROPS // BATCH))
def test_a_dropped_ragdoll_gains_no_energy_and_comes_to_rest_within_its_limits(batch: int) -> None:
    for seed in range(BATCH * batch, BATCH * (batch + 1)):
        end = drop(seed)

        assert end.most_energy < MOST_ENERGY, seed
        assert end.kinetic < RESTING, seed
        assert end.most_excess < TWITCH, seed
        assert end.last_excess < LASTING_EXCESS, seed
        assert end.far < LONGEST, seed


def test_as_a_behaviour_it_has_no_effort_and_falls() -> None:
    # Arrange
    given = {"reference": "clip", "clip": "walk"}
    own = {"behaviour": "ragdoll", "law": "computed_torque", "balance": True}
    plan = make_plan("humanoid", 1.0, given, {}, own)

    # Act
    ticks = list(ticks_in_process(plan))

    # Assert: that it has no effort although a law and balance are given
    assert "root" not in plan.simulator.texts("commanded_joints")
    assert all(not np.any(tick.following.effort) for tick in ticks)
    assert ticks[-1].following.position[2] < 0.5
    driver = controller("humanoid", behaviour="ragdoll")
    driver.answer(ticks[0].state, ticks[0].state.stamp_ns)
    assert driver.mode is not None and driver.mode.phase.mode is Mode.LIMP


def test_its_law_cannot_be_changed_while_it_runs() -> None:
    from controller_node.parameters import PARAMETERS, character_parameters, make_settings
    from msgs_config.parameters import resolve

    declared = PARAMETERS + character_parameters(HUMANOID)
    values = resolve(declared, {"behaviour": "ragdoll", "law": "pd"})

    assert make_settings(HUMANOID, values).law == "zero"
