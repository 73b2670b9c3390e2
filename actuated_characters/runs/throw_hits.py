"""Whether balls that were thrown have hit the character, and when: from their recorded motion."""

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned_throws import PlannedThrow
from msgs_config.arrays import FloatArray
from sim_node.physics.simulation import Simulation
from sim_node.physics.sphere_sweep import BallAndCharacter
from sim_node.physics.world import World, WorldSettings

_LEAST_CHANGE = 1e-3  # m/s, of a ball's velocity in a tick beside that by gravity
_NEAR = 5e-3  # m between surfaces that have just touched, and half of what the ball moves in a tick
_PUT_AWAY = 100.0  # m in a tick: the end of `ball_lifetime`

States: TypeAlias = list[tuple[FloatArray, FloatArray]]
"""Of each state after the first: the character's position (n,), and the balls' motion (m, 13)."""


def read_states(bag: Path) -> States | None:
    """The states of a recorded run; None if it has no motion of balls."""
    from actuated_characters.bags.recording import read_recording  # it needs ROS

    recording = read_recording(bag)
    nothing = np.empty((0, 13))
    motions = [nothing if balls is None else balls.motion for balls in recording.balls]
    return list(zip(recording.position, motions, strict=True))[1:] if motions else None


def watch_states(states: States, simulation: Simulation) -> None:
    """Add the present state of a simulation."""
    states.append((simulation.characters[0].state.position, simulation.ball_motion()))


def describe_hits(
    plan: RunPlan, throws: Sequence[PlannedThrow], states: States | None
) -> list[str]:
    """Of each throw a few words: whether the ball has hit the character, where, and when."""
    if states is None:
        return ["without a bag that has 'thrown' it is not known whether it hit"] * len(throws)
    in_order = sorted(range(len(throws)), key=lambda index: throws[index].stamp_ns)
    words = [""] * len(throws)
    for ball, index in enumerate(in_order):
        hit = find_hit(plan, throws[index], ball, states)
        words[index] = "missed" if hit is None else f"hit '{hit[1]}' at {hit[0]:.3f} s"
    return words


def find_hit(
    plan: RunPlan, throw: PlannedThrow, ball: int, states: States
) -> tuple[float, str] | None:
    """When a ball has first touched the character, and the link; None if it never has.

    That is at the end of the first tick, s from the first state, that has changed the ball's
    velocity, not by gravity alone, near a link. `ball` is its place in the order of throwing.
    """
    step = 1.0 / plan.simulator.integer("rate")
    fall = np.array((0.0, 0.0, -plan.simulator.number("gravity") * step))
    centre, velocity = np.array(throw.throw.position), np.array(throw.throw.velocity)
    with World(WorldSettings(ground=False)) as world:
        both = BallAndCharacter(world, plan.character, throw.throw.radius)
        for number, (position, motion) in enumerate(states, start=1):
            if len(motion) <= ball:
                continue
            moved, speed = np.linalg.norm(motion[ball, :3] - centre), np.linalg.norm(velocity)
            change = np.linalg.norm(motion[ball, 7:10] - velocity - fall)
            centre, velocity = motion[ball, :3], motion[ball, 7:10]
            if moved > _PUT_AWAY:
                break
            if change > _LEAST_CHANGE:
                both.put_character(position)
                gaps = both.put_ball(centre)
                if gaps.min() < _NEAR + 0.5 * speed * step:
                    return number * step, plan.character.links[int(gaps.argmin())].name
    return None
