"""Hits of thrown balls, told apart from what else changes a ball's motion beside the character.

What has hit is compared with the forces that the engine itself lists between ball and character.
"""

from collections.abc import Mapping, Sequence

import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.throw_hits import States, find_hit
from actuated_characters.runs.planned.throws import PlannedThrow
from msgs_config.messages.clock import TickClock
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.simulation import Simulation
from tests.support.engines import pybullet
from tests.support.physics import character
from tests.support.thrown_states import watch_states

RATE = 240
FOOT_Y = -0.085  # m, of the middle of the right foot; its tip is at x = 0.13
LINKS = [link.name for link in character("humanoid").links]

Hits = list[tuple[float, frozenset[str]] | None]
"""Of each ball: when it first pushed the character, s from the first state, and the links."""


def run_and_list_hits(plan: RunPlan, throws: Sequence[PlannedThrow]) -> tuple[States, Hits]:
    """The states of a run, and the hits by the engine's own list of contacts."""
    states: States = []
    hits: Hits = [None] * len(throws)

    def watch(run: Simulation) -> None:
        watch_states(states, run)
        for row, ball in enumerate(run._world.balls.numbers):
            if hits[row] is None and (links := _pushed_links(run, ball)):
                hits[row] = len(states) / RATE, links

    for _ in ticks_in_process(plan, (), throws, watch=watch):
        pass
    return states, hits


def _pushed_links(run: Simulation, ball: int) -> frozenset[str]:
    body = run.characters[0]._body
    points = pybullet.getContactPoints(ball, body._body, physicsClientId=body._client)
    return frozenset(LINKS[body._row[point[4]]] for point in points if point[9] > 0.0)


def hold_plan(**simulator: object) -> RunPlan:
    return make_plan("humanoid", 0.5, {"reference": "hold"}, simulator, {})


def thrown(tick: int, *balls: ProjectileThrow) -> list[PlannedThrow]:
    return [PlannedThrow(TickClock(RATE).stamp_ns(tick), ball) for ball in balls]


@pytest.mark.parametrize("simulator", [{}, {"substeps": 3}, {"friction": 0.1}], ids=str)
@pytest.mark.parametrize(
    ("x", "velocity"),
    [(0.235, (0.0, 0.0, -2.0)), (0.24, (0.0, 0.0, -8.0)), (0.225, (0.3, -0.5, -8.0))],
)
def test_a_ball_that_bounces_on_the_ground_beside_a_foot_has_missed(
    x: float, velocity: tuple[float, float, float], simulator: Mapping[str, object]
) -> None:
    plan = hold_plan(**simulator)
    throws = thrown(1, ProjectileThrow(1.0, 0.1, (x, FOOT_Y, 0.6), velocity))

    states, hits = run_and_list_hits(plan, throws)

    assert min(motion[0, 2] for _, motion in states) < 0.105  # m: it has come to the ground
    assert hits == [None]
    assert find_hit(plan, throws, 0, states) is None


def test_a_ball_that_bounces_first_has_hit_when_it_comes_to_the_foot() -> None:
    plan = hold_plan()
    throws = thrown(1, ProjectileThrow(5.0, 0.03, (-0.2108, -0.1522, 0.3372), (1.734, 0.584, -5.7)))

    states, hits = run_and_list_hits(plan, throws)

    (hit,) = hits
    assert hit is not None
    found = find_hit(plan, throws, 0, states)
    assert found is not None
    assert found[0] == pytest.approx(hit[0], abs=1e-9) and found[1] in hit[1]
    bounce = next(row for row, (_, motion) in enumerate(states) if motion[0, 9] > -5.0)
    assert (bounce + 1) / RATE < hit[0]  # s: its fall had ended before


def test_a_ball_that_another_one_hits_beside_a_foot_has_missed() -> None:
    plan = hold_plan()
    lying = ProjectileThrow(1.0, 0.1, (0.226, FOOT_Y, 0.1), (0.0, 0.0, 0.0))
    coming = ProjectileThrow(1.0, 0.1, (0.226, FOOT_Y - 0.8, 0.1), (0.0, 4.0, 0.0))
    throws = thrown(1, lying, coming)

    states, hits = run_and_list_hits(plan, throws)

    assert max(motion[0, 8] for _, motion in states) > 1.0  # m/s: it was hit by the other one
    assert hits == [None, None]
    assert [find_hit(plan, throws, ball, states) for ball in (0, 1)] == [None, None]
