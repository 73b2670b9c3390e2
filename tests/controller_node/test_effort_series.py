"""Efforts over time: written and read to the bit, held from tick to tick, or refused in a line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller_node.effort_series import EffortSeries, read_effort_series, write_effort_series
from msgs_config.arrays import FloatArray
from msgs_config.errors import EffortSeriesError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock
from tests.support.physics import (
    FLOATING_TURNED_FRAMES,
    character,
)

LAYOUT = character(FLOATING_TURNED_FRAMES).layout
PANDA = character("franka_panda").layout
PROPERTY = settings(max_examples=60, deadline=None)
RATE = 240
SLACK = 1e-7  # s
TIMES = np.array([0.5, 0.6, 0.9, 1.0])
EFFORTS = np.arange(1.0, 1.0 + 4 * LAYOUT.size).reshape(4, LAYOUT.size)
NOTHING = np.zeros(LAYOUT.size)


def written(directory: Path, text: str | bytes) -> str:
    """The path of a file with this content."""
    file = directory / "efforts.csv"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return str(file)


def read(directory: Path, text: str | bytes) -> EffortSeries:
    """The series in a file for the arm."""
    return read_effort_series(PANDA, written(directory, text))


def made(directory: Path, times: FloatArray = TIMES, efforts: FloatArray = EFFORTS) -> EffortSeries:
    """The series that is read from what was written."""
    file = directory / "efforts.csv"
    write_effort_series(file, LAYOUT, times, efforts)
    return read_effort_series(LAYOUT, str(file))


def assert_acts(series: EffortSeries, time: float, effort: FloatArray) -> None:
    assert series.at(time).tobytes() == effort.tobytes(), time


@st.composite
def series_of_rows(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    """Times, more than the slack apart, and any efforts that are finite."""
    gaps = draw(st.lists(st.floats(1e-6, 1e3), min_size=1, max_size=6))
    start = draw(st.floats(-1e3, 1e3))
    number = st.floats(allow_nan=False, allow_infinity=False)
    rows = st.lists(number, min_size=LAYOUT.size, max_size=LAYOUT.size)
    efforts = draw(st.lists(rows, min_size=len(gaps), max_size=len(gaps)))
    return start + np.cumsum(gaps), np.array(efforts)


# Writing and reading


@given(made_of=series_of_rows())
@PROPERTY
def test_what_is_written_is_read_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory, made_of: tuple[FloatArray, FloatArray]
) -> None:
    times, efforts = made_of
    directory = tmp_path_factory.mktemp("series")

    series = made(directory, times, efforts)

    for time, effort in zip(times.tolist(), efforts, strict=True):
        assert_acts(series, time, effort)
    by_numpy = np.loadtxt(directory / "efforts.csv", delimiter=",", skiprows=1, ndmin=2)
    assert by_numpy.tobytes() == np.column_stack([times, efforts]).tobytes()


def test_the_header_is_the_time_and_every_degree_of_freedom(tmp_path: Path) -> None:
    made(tmp_path)

    header = (tmp_path / "efforts.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header == ",".join(["time_s", *LAYOUT.dof_names])


def test_columns_may_come_in_any_order_and_those_that_are_missing_are_zero(tmp_path: Path) -> None:
    file = written(tmp_path, "time_s,wrist_z,elbow,wrist_x,wrist_y\n0,3,4,1,2\n")

    effort = read_effort_series(LAYOUT, file).at(0.0)

    efforts = {"wrist_x": 1.0, "wrist_y": 2.0, "wrist_z": 3.0, "elbow": 4.0}
    assert effort.tolist() == [efforts.get(name, 0.0) for name in LAYOUT.dof_names]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"], ids=["Unix", "Windows", "old Mac"])
def test_lines_may_end_as_on_any_system(tmp_path: Path, end: str) -> None:
    series = read(tmp_path, end.join(["time_s,panda_joint1", "0,1.5", "1e-1, -2"]))

    assert [series.at(time)[0] for time in (0.0, 0.1)] == [1.5, -2.0]


# Which effort acts

ACTS = {  # times in s, and the row that acts then; None: nothing
    "from its time until the next one": ((0.5, 0), (0.599, 0), (0.6, 1), (0.8999, 1), (0.95, 2)),
    "not before the first": ((-1.0, None), (0.0, None), (0.4999, None)),
    "the last as long as the one before": ((1.0, 3), (1.0999, 3), (1.1, None), (1e9, None)),
    "hardly too early": (
        (0.6 - 0.9 * SLACK, 1),
        (0.6 - 1.1 * SLACK, 0),
        (0.5 - 0.9 * SLACK, 0),
        (0.5 - 1.1 * SLACK, None),
        (1.1 - 0.9 * SLACK, None),
    ),
}


@pytest.mark.parametrize("case", ACTS)
def test_an_effort_acts_when_its_time_has_come(tmp_path: Path, case: str) -> None:
    series = made(tmp_path)

    for time, row in ACTS[case]:
        assert_acts(series, time, NOTHING if row is None else EFFORTS[row])


def test_a_single_one_acts_forever(tmp_path: Path) -> None:
    series = made(tmp_path, TIMES[:1], EFFORTS[:1])

    assert_acts(series, 0.4999, NOTHING)
    assert_acts(series, 1e9, EFFORTS[0])


@given(
    st.integers(1, 100_000),
    st.integers(1, 10**7),
    st.integers(1, 10**7),
    st.sampled_from(["tick / rate", "8 digits", "stamps"]),
)
@PROPERTY
def test_every_tick_gets_its_own_effort_wherever_the_episode_begins(
    rate_hz: int, first: int, ticks: int, kind: str
) -> None:
    """Stamps are whole nanoseconds; a file's times are quotients, or rounded to 8 digits."""
    # Arrange
    clock = TickClock(rate_hz)
    start_ns = clock.stamp_ns(first)
    around = [ticks - 1, ticks, ticks + 1]
    since_ns = [clock.stamp_ns(first + tick) - start_ns for tick in around]
    times = {
        "tick / rate": [tick / rate_hz for tick in around],
        "8 digits": [float(f"{tick / rate_hz:.8f}") for tick in around],
        "stamps": [since / NANOSECONDS_PER_SECOND for since in since_ns],
    }[kind]
    series = EffortSeries(np.array(times), np.array([[1.0], [2.0], [3.0]]))

    # Act
    efforts = [series.at(since / NANOSECONDS_PER_SECOND)[0] for since in since_ns]

    # Assert
    assert efforts == [1.0, 2.0, 3.0]


def test_an_effort_is_the_callers_own(tmp_path: Path) -> None:
    series = made(tmp_path)

    for time, effort in ((0.5, EFFORTS[0]), (0.0, NOTHING)):
        series.at(time)[:] = 99.0
        assert_acts(series, time, effort)


# Files that are refused

REFUSED: dict[str, tuple[str | bytes, list[str]]] = {
    "empty": ("", ["'time_s'", "one row or more"]),
    "without rows": ("time_s,panda_joint1\n", ["one row or more"]),
    "without a header": ("0,1\n0.1,2\n", ["header 'time_s'"]),
    "with another header": ("t,panda_joint1\n0,1\n", ["header 'time_s'"]),
    "with a blank line first": ("\ntime_s,panda_joint1\n0,1\n", ["header 'time_s'"]),
    "of an unknown name": ("time_s,panda_joint9\n0,1\n", ["'panda_joint9'", "panda_joint7"]),
    "of a name twice": ("time_s,panda_joint1,panda_joint1\n0,1,1\n", ["'panda_joint1'", "twice"]),
    "with too few numbers": ("time_s,panda_joint1,panda_joint2\n0,1,2\n0.1,1\n", ["line 3", "3 n"]),
    "with one number": ("time_s,panda_joint1,panda_joint2\n0,1,2\n0.1\n", ["line 3", "3 numbers"]),
    "with too many": ("time_s,panda_joint1\n0,1\n0.1,2,3\n", ["line 3", "2 numbers"]),
    "with a blank line": ("time_s,panda_joint1\n0,1\n\n0.1,2\n", ["line 3", "2 numbers"]),
    "with no number": ("time_s,panda_joint1\n0,much\n", ["line 2", "2 numbers"]),
    "with an empty field": ("time_s,panda_joint1\n0,1\n0.1,\n", ["line 3", "2 numbers"]),
    "with NaN": ("time_s,panda_joint1\n0,1\n0.1,nan\n", ["line 3", "not finite"]),
    "with infinity": ("time_s,panda_joint1\n0,-inf\n", ["line 2", "not finite"]),
    "with a number too large": ("time_s,panda_joint1\n0,1e999\n", ["line 2", "not finite"]),
    "with an endless time": ("time_s,panda_joint1\n0,1\ninf,1\n", ["line 3", "not finite"]),
    "with a time twice": ("time_s,panda_joint1\n0,1\n0.25,2\n0.25,3\n", ["line 4", "0.25 s"]),
    "going back": ("time_s,panda_joint1\n0,1\n0.5,2\n0.25,3\n0.75,4\n", ["line 4", "0.25", "0.5"]),
    "that is no text": (b"time_s,panda_joint1\n0,\xff\xfe\n", ["not a text file"]),
    "with an endless field": ('time_s,panda_joint1\n0,"' + 200_000 * "1", ["not valid CSV"]),
}


@pytest.mark.parametrize("wrong", REFUSED)
def test_a_file_that_is_wrong_is_refused_with_what_would_be_right(
    tmp_path: Path, wrong: str
) -> None:
    text, expected = REFUSED[wrong]

    with pytest.raises(EffortSeriesError) as caught:
        read(tmp_path, text)

    line = str(caught.value)
    assert line.startswith(str(tmp_path / "efforts.csv"))
    assert "\n" not in line and len(line) < len(str(tmp_path)) + 300
    assert all(part in line for part in expected)


def test_a_ball_joint_in_parts_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path, "time_s,wrist_x,wrist_z\n0,1,2\n")

    with pytest.raises(EffortSeriesError, match=r"efforts\.csv: joint 'wrist' .*'wrist_y'"):
        read_effort_series(LAYOUT, file)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EffortSeriesError, match=r"nowhere\.csv: No such file"):
        read_effort_series(PANDA, str(tmp_path / "nowhere.csv"))
    with pytest.raises(EffortSeriesError, match="not a file"):
        read_effort_series(PANDA, str(tmp_path))


@given(st.text(st.sampled_from("01.5-e,\"\n\r\t nax;'\0"), max_size=40))
@PROPERTY
def test_whatever_the_rows_are_they_are_refused_in_one_line_or_finite(
    tmp_path_factory: pytest.TempPathFactory, rows: str
) -> None:
    file = written(tmp_path_factory.mktemp("series"), f"time_s,panda_joint1\n{rows}")

    try:
        series = read_effort_series(PANDA, file)
    except EffortSeriesError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert all(np.isfinite(series.at(time)).all() for time in np.linspace(-60.0, 60.0, 50))
