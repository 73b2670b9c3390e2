"""The attempt at a run, as its benchmark measures it."""

import numpy as np
import pytest

from benchmarks.athletics.runs import AIRBORNE, ATTEMPT, MEASURED, Run, nudges, run
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
def test_it_has_both_feet_in_the_air_and_is_not_faster_than_it_says() -> None:
    seen = run(read_machine(str(ATTEMPT)), 0, 2.0, seconds=3.0)

    assert seen.lasted == pytest.approx(3.0, abs=0.01)
    assert seen.airborne > AIRBORNE and seen.flight > 0.03
    assert 0.35 < seen.speed < 0.75
    assert not seen.succeeded(1.9)


def test_a_run_that_falls_or_walks_or_is_slow_does_not_count() -> None:
    good = Run(1, MEASURED, 2.0, 0.2, 0.06)

    assert good.succeeded(1.9)
    for bad in (
        Run(1, 19.0, 2.0, 0.2, 0.06),
        Run(1, MEASURED, 1.5, 0.2, 0.06),
        Run(1, 20, 2, 0, 0),
    ):
        assert not bad.succeeded(1.9)
