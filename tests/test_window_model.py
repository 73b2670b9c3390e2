"""What window feedback is fitted from: the model of the deviations, and its regulator."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from experiment.samcon.identification import CycleModel, Transitions, WindowModel, identified
from experiment.samcon.regulator import regulator
from msgs_config.arrays import FloatArray
from msgs_config.errors import RunError

RNG = np.random.default_rng(4)


# The model

WIDTH, MOVED, CYCLE = 4, 2, 3
LARGEST = np.array((0.5, 2.0))
TRUE = RNG.normal(size=(CYCLE, WIDTH, WIDTH + MOVED + 1))


def transitions(count: int, noise: float = 0.0) -> Transitions:
    rng = np.random.default_rng(5)
    phases = np.arange(count) % CYCLE
    before, offsets = rng.normal(size=(count, WIDTH)), LARGEST * rng.normal(size=(count, MOVED))
    rows = np.hstack((before, offsets, np.ones((count, 1))))
    after = np.array([TRUE[phase] @ row for phase, row in zip(phases, rows, strict=True)])
    return Transitions(phases, before, offsets, after + noise * rng.normal(size=after.shape))


def predicted(model: CycleModel, phase: int, state: FloatArray, offset: FloatArray) -> FloatArray:
    row = np.concatenate((state / model.spreads, offset / model.largest, [1.0]))
    found: FloatArray = (model.windows[phase].matrix @ row) * model.spreads
    return found


def test_a_linear_motion_is_identified_window_by_window() -> None:
    model = identified(transitions(30_000), LARGEST, CYCLE)
    state, offset = RNG.normal(size=WIDTH), RNG.normal(size=MOVED)

    for phase in range(CYCLE):
        wanted = TRUE[phase] @ np.concatenate((state, offset, [1.0]))
        np.testing.assert_allclose(predicted(model, phase, state, offset), wanted, atol=5e-3)


def test_what_is_not_explained_is_the_residual() -> None:
    model = identified(transitions(30_000, noise=0.3), LARGEST, CYCLE)

    for window in model.windows:
        unit = np.diag(model.spreads) @ window.residual @ np.diag(model.spreads)
        np.testing.assert_allclose(unit, 0.09 * np.eye(WIDTH), atol=0.01)


# The regulator


def one_window(*rows: list[float], largest: float = 1.0) -> CycleModel:
    """A cycle of one number, one offset, and no doubt: a row (a, b, c) a window."""
    windows = tuple(
        WindowModel(np.array([row]), np.zeros((3, 3)), np.zeros((1, 1))) for row in rows
    )
    return CycleModel(windows, np.ones(1), np.array([largest]))


def test_a_cycle_of_one_window_gets_the_gain_of_the_riccati_equation() -> None:
    a, b, q, r = 1.3, 0.7, 1.0, 2.0
    model = one_window([a, b, 0.0])

    gains = regulator(model, ("hinge",), caution=0.0, offset_cost=r)

    # p = q + a^2 p r / (r + b^2 p), a quadratic in p
    half = 0.5 * (b * b * q + (a * a - 1.0) * r) / (b * b)
    p = half + sqrt(half * half + q * r / (b * b))
    assert gains.gains[0, 0, 0] == pytest.approx(-a * b * p / (r + b * b * p), rel=1e-4)
    assert gains.constants[0, 0] == 0.0


def cost(gains: FloatArray, constants: FloatArray, rows: list[list[float]]) -> float:
    """What a feedback of a cycle costs from 1 on, in many cycles."""
    state, total = 1.0, 0.0
    for step in range(200 * len(rows)):
        a, b, c = rows[step % len(rows)]
        offset = gains[step % len(rows)] * state + constants[step % len(rows)]
        state = a * state + b * offset + c
        total += state * state + 2.0 * float(offset) ** 2
    return float(total)


def test_no_other_feedback_of_a_cycle_costs_less() -> None:
    rows = [[1.3, 0.7, 0.1], [0.4, -2.0, -0.2], [1.8, 0.3, 0.0]]
    found = regulator(one_window(*rows), ("hinge",), caution=0.0, offset_cost=2.0)
    gains, constants = found.gains[:, 0, 0], found.constants[:, 0]

    least = cost(gains, constants, rows)

    for row in range(len(rows)):
        for change in (-0.02, 0.02):
            other = np.where(np.arange(len(rows)) == row, change, 0.0)
            assert cost(gains + other, constants, rows) > least
            assert cost(gains, constants + other, rows) > least


def test_an_offset_whose_effect_is_in_doubt_is_used_less() -> None:
    sure = one_window([1.3, 0.7, 0.0])
    doubt = replace(
        sure.windows[0], covariance=np.diag((0.0, 0.5, 0.0)), residual=np.array([[1.0]])
    )
    unsure = replace(sure, windows=(doubt,))

    wary = regulator(unsure, ("hinge",), caution=1.0, offset_cost=2.0).gains[0, 0, 0]
    bold = regulator(sure, ("hinge",), caution=1.0, offset_cost=2.0).gains[0, 0, 0]

    assert bold < wary < 0.0


def test_doubt_is_the_cost_that_the_expected_square_has() -> None:
    a, b, doubt, residual, caution = 1.3, 0.7, 0.5, 0.4, 3.0
    window = WindowModel(
        np.array([[a, b, 0.0]]), np.diag((0.0, doubt, 0.0)), np.array([[residual]])
    )
    model = CycleModel((window,), np.ones(1), np.ones(1))

    found = regulator(model, ("hinge",), caution=caution, offset_cost=2.0).gains[0, 0, 0]

    # E (a s + (b + e) u)^2 p, where e has `caution` times the variance `doubt * residual`
    value = 1.0
    for _ in range(12):  # windows
        gain = -a * b * value / ((b * b + caution * doubt * residual) * value + 2.0)
        value = 1.0 + a * (a + b * gain) * value
    assert found == pytest.approx(gain, rel=1e-4)


def test_gains_stay_numbers_where_what_is_expected_grows_for_ever() -> None:
    rng = np.random.default_rng(6)
    count, width, moved, windows = 1200, 20, 6, 40
    few = Transitions(
        np.arange(count) % windows,
        rng.normal(size=(count, width)),
        rng.normal(size=(count, moved)),
        3.0 * rng.normal(size=(count, width)),
    )
    model = identified(few, np.ones(moved), windows)

    found = regulator(model, ("hinge",) * moved, caution=1e5)

    assert np.isfinite(found.gains).all()
    assert np.isfinite(found.constants).all()


def test_a_window_that_was_never_seen_is_in_doubt() -> None:
    seen = transitions(300)
    rows = seen.phases != 1
    model = identified(
        Transitions(seen.phases[rows], seen.before[rows], seen.offsets[rows], seen.after[rows]),
        LARGEST,
        CYCLE,
    )

    np.testing.assert_allclose(model.windows[1].residual, np.eye(WIDTH))
    assert not model.windows[1].matrix.any()


def test_without_any_transition_nothing_is_fitted() -> None:
    with pytest.raises(RunError, match="nothing can be fitted"):
        identified(transitions(0), LARGEST, CYCLE)


def test_the_unit_of_an_offset_does_not_matter() -> None:
    row = [1.3, 0.7, 0.2]
    unit = regulator(one_window(row), ("hinge",), caution=0.0, offset_cost=2.0)
    fifth = [row[0], row[1] * 0.2, row[2]]
    scaled = regulator(one_window(fifth, largest=0.2), ("hinge",), caution=0.0, offset_cost=0.08)

    np.testing.assert_allclose(scaled.gains, unit.gains, rtol=1e-4)
    np.testing.assert_allclose(scaled.constants, unit.constants, rtol=1e-4)
