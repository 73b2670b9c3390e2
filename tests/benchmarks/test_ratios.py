"""The ratios of `make bench`: what got dearer is told from what merely scatters, and is red."""

import math
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.cost import Cost, cost_ratios
from benchmarks.support.ratios import (
    Ratio,
    RatioComparison,
    compare,
    comparison_table,
    read_ratios,
    store_ratios,
)
from msgs_config.errors import ConfigurationError

STORED = {"law pd": 0.5, "search": 20.0}


def of(figure: str, value: float) -> Ratio:
    return Ratio(figure, value, "this / that")


def compared(value: float) -> RatioComparison:
    (comparison,) = compare([of("law pd", value)], STORED)
    return comparison


@pytest.mark.parametrize(("value", "change"), [(0.61, 0.22), (50.0, 99.0), (math.inf, math.inf)])
def test_what_is_more_than_a_fifth_above_the_stored_ratio_is_worse(
    value: float, change: float
) -> None:
    comparison = compared(value)

    assert comparison.is_worse
    assert comparison.change == pytest.approx(change)


@pytest.mark.parametrize("value", [0.59, 0.5, 0.1])
def test_what_scatters_or_is_better_is_not(value: float) -> None:
    assert not compared(value).is_worse


def test_a_ratio_that_is_no_number_is_worse() -> None:
    assert compared(math.nan).is_worse


def test_a_figure_that_is_not_stored_is_compared_with_nothing() -> None:
    (new,) = compare([of("law magic", 3.0)], STORED)

    assert (new.stored, new.change, new.is_worse) == (None, None, False)


def lines(comparisons: list[RatioComparison]) -> dict[str, str]:
    """What is printed for each figure, with the terminal's codes of colour."""
    console = Console(width=100, force_terminal=True, color_system="standard", no_color=False)
    with console.capture() as capture:
        console.print(comparison_table(comparisons))
    printed = capture.get().splitlines()
    return {
        c.ratio.figure: next(line for line in printed if c.ratio.figure in line)
        for c in comparisons
    }


RED = "\x1b[1;31m"


def test_what_got_worse_is_printed_in_red_beside_the_stored_ratio_and_nothing_else_is() -> None:
    printed = lines(compare([of("law pd", 0.75), of("search", 21.0), of("new", 9.0)], STORED))

    assert RED in printed["law pd"]
    assert all(text in printed["law pd"] for text in ("0.75", "0.5", "+50 %"))
    assert RED not in printed["search"] + printed["new"]
    assert "none" in printed["new"]


def test_what_is_stored_is_read_again_and_other_figures_stay(tmp_path: Path) -> None:
    path = tmp_path / "ratios.yaml"
    assert read_ratios(path) == {}

    store_ratios([of("law pd", 0.5), of("search", 20.0)], path)
    store_ratios([of("search", 1.0 / 3.0)], path)

    assert read_ratios(path) == pytest.approx({"law pd": 0.5, "search": 1.0 / 3.0}, rel=1e-3)
    assert path.read_text("utf-8").startswith("#")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("- 1\n", "mapping of figures"),
        ("law pd: 0.5\n", "'law pd': ratio is None"),
        ("law pd: {ratio: 0}\n", "'law pd': ratio is 0; must be a positive number"),
        ("law pd: {ratio: .nan}\n", "ratio is nan"),
        ("law pd: {ratio: half}\n", "ratio is 'half'"),
    ],
)
def test_a_file_that_holds_no_ratios_is_one_clear_line(
    tmp_path: Path, text: str, complaint: str
) -> None:
    path = tmp_path / "ratios.yaml"
    path.write_text(text)

    for use in (lambda: read_ratios(path), lambda: store_ratios([of("search", 1.0)], path)):
        with pytest.raises(ConfigurationError, match=complaint) as caught:
            use()
        assert str(caught.value).startswith(str(path))
    assert path.read_text() == text


def test_the_limp_humanoid_beside_the_engine_alone_is_among_the_ratios() -> None:
    costs = [Cost("1 humanoid", 34, 100.0, 250.0, 400.0), Cost("8 humanoids", 272, 9e2, 3e3, 4e3)]

    ratios = {ratio.figure: ratio.value for ratio in cost_ratios(costs)}

    assert ratios["1 humanoid"] == 2.5
    assert ratios["8 humanoids, growth"] == pytest.approx(1.5)
    assert ratios["1 humanoid, topics"] == pytest.approx(1.6)
