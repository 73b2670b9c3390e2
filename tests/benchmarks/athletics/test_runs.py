"""The machine `run`, as its benchmark measures it."""

import numpy as np
import pytest

from benchmarks.athletics.runs import (
    AIRBORNE,
    MEASURED,
    SPEED,
    Run,
    draw_trials,
    nudges,
    run,
    search_cost,
)
from controller_node.behaviours.state_machine.file import read_machine


def test_nudges_are_small_and_one_in_each_four_seconds() -> None:
    pushes = nudges(3, 5.0, 20.0)

    times = [float(text.split("@")[1]) for text in pushes]
    assert len(pushes) == 5 and [int((time - 5.0) / 4.0) for time in times] == [0, 1, 2, 3, 4]
    for text in pushes:
        x, y, z = (float(number) for number in text.removeprefix("root:").split("@")[0].split(","))
        assert 10.0 <= np.sqrt(x * x + y * y) <= 30.0 and z == 0.0
    assert nudges(0, 5.0, 20.0) == []


@pytest.mark.slow
def test_it_runs() -> None:
    seen = run(read_machine("run"), 0, 2.1, seconds=4.0)

    assert seen.lasted == pytest.approx(4.0, abs=0.01)
    assert seen.airborne > AIRBORNE and seen.flight > 0.03
    assert seen.speed == pytest.approx(2.1, abs=0.2)


@pytest.mark.slow
def test_a_search_pays_for_what_is_no_run() -> None:
    trials = draw_trials(np.random.default_rng(1), 1, 240)

    assert search_cost(read_machine("run"), trials) < 4.0
    assert search_cost(read_machine("walk"), trials) > 6.0


def test_a_run_that_falls_or_walks_or_is_slow_does_not_count() -> None:
    good = Run(1, MEASURED, SPEED, 0.2, 0.06)

    assert good.succeeded
    for bad in (
        Run(1, 19.0, SPEED, 0.2, 0.06),
        Run(1, MEASURED, 1.9, 0.2, 0.06),
        Run(1, MEASURED, SPEED, 0.0, 0.0),
    ):
        assert not bad.succeeded
