"""What a ratio of lockstep is printed with: the numbers that it is made of, and the machine."""

import math
import os

import pytest

from benchmarks.lockstep import RATIOS, Formula, made_of
from benchmarks.support.machine import describe_machine

US = {"a": 84.0, "b": 99.0, "c": 349.4, "d": 191.0, "e": 40.0}


@pytest.mark.parametrize(("figure", "how", "formula"), RATIOS)
def test_a_ratio_is_what_its_printed_numbers_say(figure: str, how: str, formula: Formula) -> None:
    numbers, value = made_of(how, formula, US)

    assert not set("abcde") & set(numbers)
    assert eval(numbers) == pytest.approx(float(value), rel=0.01)


def test_what_was_not_measured_is_left_empty() -> None:
    _, how, formula = RATIOS[-1]

    assert made_of(how, formula, {**US, "e": math.nan}) == ("", "")


def test_the_machine_is_a_processor_and_how_many() -> None:
    model, _, count = describe_machine().rpartition(", ")

    assert model
    assert count == f"{os.cpu_count()} processors"
