"""What the tables of planned motion say is what was drawn, thrown, weighed and fitted."""

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.planner.clips import _with_mass
from benchmarks.planner.push_picture import half_borne
from benchmarks.planner.pushes import _plan, _planned, _throws
from benchmarks.planner.walks import KINDS, walks
from msgs_config.character.loading import load_character
from msgs_config.messages.clock import TickClock


def test_half_are_borne_where_a_logistic_curve_says_so() -> None:
    draw = np.random.default_rng(0)
    sides, sizes = draw.uniform(-math.pi, math.pi, 4000), draw.uniform(30.0, 200.0, 4000)
    true = 90.0 * np.exp(0.2 * np.cos(sides) - 0.1 * np.cos(2.0 * sides))
    borne = draw.uniform(size=4000) < 1.0 / (1.0 + (sizes / true) ** 8)
    around = np.array([0.0, math.pi / 2.0, math.pi])

    found = half_borne(sides, sizes, borne, around)

    expected = 90.0 * np.exp([0.1, 0.1, -0.3])
    np.testing.assert_allclose(found, expected, rtol=0.04)


def test_walks_are_pushed_as_their_kind_says() -> None:
    for kind in ("10 N s every 2 s", "48 or 60 N s", "any"):
        for walk in walks(kind, 6, ()):
            plan = _plan(walk)
            pushes = _planned(plan, walk)
            assert len(pushes) == KINDS[kind].pushes
            for push in pushes:
                impulse = KINDS[kind].lasts * math.hypot(*push.wrench[:2])
                assert {
                    "10 N s every 2 s": math.isclose(impulse, 10.0),
                    "48 or 60 N s": min(abs(impulse - 48.0), abs(impulse - 60.0)) < 1e-9,
                    "any": 40.0 <= impulse <= 240.0,
                }[kind]


def test_a_ball_arrives_from_its_side_at_its_time() -> None:
    (walk,) = walks("balls", 1, ())
    plan = _plan(walk)
    clock = TickClock(plan.simulation.rate_hz)

    throws = _throws(plan, walk)

    assert len(throws) == 5 == len(walk.pushes)
    for push, thrown in zip(walk.pushes, throws, strict=True):
        ball, velocity = thrown.throw, np.array(thrown.throw.velocity[:2])
        flies = push.time - (clock.first_tick_from(thrown.stamp_ns) - 1) / clock.rate_hz
        chest = plan.reference.sample(push.time).configuration.position[:2]
        assert ball.mass == 2.5 and 0.1 < flies < 0.3
        assert math.hypot(*velocity) == pytest.approx(8.0)
        left = chest - np.array(ball.position[:2]) - flies * velocity
        assert 0.0 < float(left @ velocity) / 8.0 < 0.4  # touches, and has not passed
        assert abs(float(left[0] * velocity[1] - left[1] * velocity[0])) / 8.0 < 0.15


def test_a_heavier_character_is_heavier_and_else_the_same(tmp_path: Path) -> None:
    usual, heavier = (
        load_character("humanoid"),
        load_character(_with_mass("humanoid", 1.1, tmp_path)),
    )

    assert heavier.layout.dof_names == usual.layout.dof_names
    for one, other in zip(heavier.links, usual.links, strict=True):
        assert one.mass == pytest.approx(1.1 * other.mass)
        inertia = 1.1 * np.array(other.inertia_diagonal)
        np.testing.assert_allclose(one.inertia_diagonal, inertia, rtol=1e-6)
