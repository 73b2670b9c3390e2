"""The file of a search: what it says, and each mistake in a line."""

from pathlib import Path

import pytest

from actuated_characters.boundary.bisection import Way
from actuated_characters.boundary.file import Search, read_search
from actuated_characters.commands.common.row_runs import row_options
from actuated_characters.sweep.row import FIGURES, Outcome
from msgs_config.errors import ConfigurationError

GOOD = """
run: {machine: walk, push: "impulse={impulse} from={side} at={time} target=chest"}
values: {time: [2.0, 2.5], side: [0, 90, 180]}
search: {value: impulse, from: 0, to: 80, within: 1, around: side}
"""


def read(folder: Path, text: str) -> Search:
    file = folder / "search.yaml"
    file.write_text(text)
    return read_search(file, row_options(), FIGURES)


def test_points_are_the_grid_of_all_but_the_value(tmp_path: Path) -> None:
    search = read(tmp_path, GOOD)

    assert search.points() == [
        (1 + number, {"time": time, "side": side})
        for number, (time, side) in enumerate(
            (time, side) for time in (2.0, 2.5) for side in (0, 90, 180)
        )
    ]
    assert search.way == Way(0, 80, 1, 8, whole=True)


def test_a_points_run_has_its_choices_and_the_value(tmp_path: Path) -> None:
    row = read(tmp_path, GOOD).row(5, 40, 17)

    assert row.number == 17
    assert row.arguments == (
        "--machine=walk",
        "--push=impulse=40 from=90 at=2.5 target=chest",
    )
    assert row.cells == {"time": 2.5, "side": 90, "impulse": 40}


def test_a_parameter_may_be_searched_and_downwards(tmp_path: Path) -> None:
    search = read(
        tmp_path,
        "run: {machine: walk}\n"
        "search: {value: sim_node.friction, from: 1.0, to: 0.1, within: 0.05, steps: 3}\n",
    )

    assert search.way == Way(1.0, 0.1, 0.05, 3)
    assert search.row(1, 0.5, 1).arguments[-1] == "--set=sim_node.friction:=0.5"


def test_a_run_fails_by_its_fall_or_by_a_figure_above_its_limit(tmp_path: Path) -> None:
    by_fall = read(tmp_path, GOOD)
    by_figure = read(tmp_path, GOOD.replace("within: 1", "within: 1, fails: {root_error_max_m: 1}"))

    assert by_fall.has_failed(Outcome({"fell": True, "root_error_max_m": 0.1}))
    assert not by_fall.has_failed(Outcome({"fell": False, "root_error_max_m": 9.0}))
    assert by_figure.has_failed(Outcome({"fell": False, "root_error_max_m": 1.1}))
    assert by_figure.has_failed(Outcome({"fell": True, "root_error_max_m": 1.0})) is False
    assert by_figure.has_failed(Outcome({"fell": True, "root_error_max_m": None})) is None
    assert by_fall.has_failed(Outcome({"fell": None})) is None
    assert by_fall.has_failed(Outcome({}, error="it diverged"))
    assert by_fall.has_failed(Outcome({}, error="no such clip", is_refused=True)) is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("value: impulse, ", "", "search.value is None; it must be a text"),
        ("value: impulse", "value: size", "of the place {impulse}: unknown value 'impulse'"),
        ("value: impulse", "value: camera.zoom", "unknown node 'search.camera'"),
        (
            "value: impulse",
            "value: fell",
            "search.fell is the name of another column",
        ),
        ("to: 80", "to: 0", "search.to is 0.0; it must be another number than 'from'"),
        ("within: 1", "within: 0", "search.within is 0.0; it must be above 0, and 80 at most"),
        ("within: 1", "within: 99", "above 0, and 80 at most"),
        ("within: 1", "within: 1, steps: 0", "search.steps is 0; it must be a whole number"),
        ("within: 1", "within: 1, fails: late", "search.fails is 'late'; it must be 'fell', or"),
        ("within: 1", "within: 1, fails: {height: 1}", "unknown figure 'search.fails.height'"),
        ("within: 1", "within: 1, by: bayes", "unknown key 'search.by'"),
        ("around: side", "around: way", "unknown column 'search.way'"),
        ("from: 0, ", "", "search.from is None; it must be a finite number"),
        ("search: {", "look: {", "unknown key 'look'"),
        ("values: {", "bags: failures\nvalues: {", "bags is 'failures'; it must be 'all' or"),
        (
            "within: 1",
            "within: 1, fails: {fell_in_mode: 1}",
            "unknown figure 'search.fails.fell_in",
        ),
    ],
)
def test_a_mistake_is_one_line_that_names_it(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert old in GOOD
    with pytest.raises(ConfigurationError) as error:
        read(tmp_path, GOOD.replace(old, new))

    text = str(error.value)
    assert text.startswith(str(tmp_path / "search.yaml"))
    assert message in text
    assert "\n" not in text
