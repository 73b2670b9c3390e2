"""Whether what was thrown has hit the character, and when: from its recorded motion."""

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.throws import PlannedThrow
from msgs_config.arrays import FloatArray
from sim_node.physics.balls.sphere_sweep import BallAndCharacter
from sim_node.physics.engine import World, make_world
from sim_node.physics.settings import WorldSettings
from sim_node.simulation_factory import make_simulation_settings

_LEAST_CHANGE = 1e-3  # m/s, of a ball's velocity in a tick beside that without the character
# So far, m, beside half of what the ball moves in a tick, are surfaces that have just touched.
_NEAR_DISTANCE = 5e-3
_PUT_AWAY = 100.0  # m in a tick: the end of `ball_lifetime`

States: TypeAlias = list[tuple[FloatArray, FloatArray]]
"""Of each state after the first: the character's position (n,), and the balls' motion (m, 13)."""


def read_states(bag: Path) -> States | None:
    """The states of a recorded run; None if it has no motion of balls."""
    from actuated_characters.bags.recording import read_recording

    recording = read_recording(bag)
    nothing = np.empty((0, 13))
    motions = [nothing if balls is None else balls.motion for balls in recording.balls]
    return list(zip(recording.position, motions, strict=True))[1:] if motions else None


def describe_hits(
    plan: RunPlan, throws: Sequence[PlannedThrow], states: States | None, since: float = 0.0
) -> list[str]:
    """Of each throw a few words: whether the ball has hit the character, where, and when.

    The time is told from `since` s before the first of the states.
    """
    if states is None:
        return ["without a bag that has 'thrown' it is not known whether it hit"] * len(throws)
    in_order = sorted(range(len(throws)), key=lambda index: throws[index].stamp_ns)
    words = [""] * len(throws)
    for ball, index in enumerate(in_order):
        hit = find_hit(plan, [throws[each] for each in in_order], ball, states)
        words[index] = "missed" if hit is None else f"hit '{hit[1]}' at {since + hit[0]:.3f} s"
    return words


def find_hit(
    plan: RunPlan, in_order: Sequence[PlannedThrow], ball: int, states: States
) -> tuple[float, str] | None:
    """When a ball has first touched the character, and the link; None if it never has.

    That is at the end of the first tick, s from the first state, in which the ball's velocity
    became, near a link, another one than gravity, the ground and the other balls would give it.
    `ball` is its place among the throws, which are in their order in time.
    """
    settings = make_simulation_settings(plan.simulator)
    step = 1.0 / settings.rate_hz
    still = WorldSettings(engine=settings.world.engine, ground=False)
    with make_world(settings.world) as alone, make_world(still) as world:
        both = BallAndCharacter(world, plan.character, in_order[ball].throw)
        for number, (position, motion) in enumerate(states, start=1):
            for planned in in_order[len(alone.balls.throws) : len(motion)]:
                alone.balls.add(planned.throw)
            before, expected = _step_alone(alone, settings.substeps)
            alone.balls.set_motion(motion)
            if len(motion) <= ball:
                continue
            centre, speed = motion[ball, :3], np.linalg.norm(before[ball, 7:10])
            if np.linalg.norm(centre - before[ball, :3]) > _PUT_AWAY:
                break
            if np.linalg.norm(motion[ball, 7:10] - expected[ball, 7:10]) > _LEAST_CHANGE:
                both.put_character(position)
                gaps = both.put_ball(centre, motion[ball, 3:7])
                if gaps.min() < _NEAR_DISTANCE + 0.5 * speed * step:
                    return number * step, plan.character.links[int(gaps.argmin())].name
    return None


def _step_alone(world: World, substeps: int) -> tuple[FloatArray, FloatArray]:
    """The balls' motion (m, 13) before and after a tick in which there is no character."""
    before = world.balls.motion()
    for _ in range(substeps):
        world.step()
    return before, world.balls.motion()
