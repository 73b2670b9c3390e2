"""Efforts over time, recorded or computed: what the law `feedforward` applies."""

import csv
import math
from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from io import StringIO
from itertools import chain
from pathlib import Path

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.errors import EffortSeriesError, LayoutError
from msgs_config.files import read_text

TIME_COLUMN = "time_s"

_SLACK = 1e-7  # s: a stamp is a whole number of ns, a tick's time in a file often is not


class EffortSeries:
    """Efforts that each hold until the next one's time; after the last there is none."""

    def __init__(self, times: FloatArray, efforts: FloatArray) -> None:
        """`times` (t,) s since the episode's first state, rising; `efforts` (t - 1, n) or more.

        The effort at row k acts from `times[k]` on.
        """
        self._times: list[float] = times.tolist()
        self._efforts = efforts
        self._none = np.zeros(efforts.shape[1])

    def at(self, time: float) -> FloatArray:
        """The effort (n,) that acts at a time in s."""
        row = bisect_right(self._times, time + _SLACK) - 1
        return self._efforts[row].copy() if 0 <= row < len(self._efforts) else self._none.copy()


def read_effort_series(layout: JointLayout, path: str) -> EffortSeries:
    """Read a CSV file whose header is `time_s` and the names of degrees of freedom.

    Those that have no column get no effort. The last row acts as long as the one before it, a
    single one forever.

    Raises:
        EffortSeriesError: names the file, the line and what would be right.
    """
    file = Path(path)
    text = read_text(file, EffortSeriesError).removeprefix("\ufeff").rstrip()
    try:
        return _parse(layout, file, csv.reader(StringIO(text)))
    except csv.Error as error:
        raise EffortSeriesError(f"{file}: not valid CSV: {error}") from error


def write_effort_series(
    path: Path, layout: JointLayout, times: FloatArray, efforts: FloatArray
) -> None:
    """Write efforts (t, n) at times (t,) in s, to the last bit; OSError if that cannot be done."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([TIME_COLUMN, *layout.dof_names])
        writer.writerows(
            [time, *effort] for time, effort in zip(times.tolist(), efforts.tolist(), strict=True)
        )


def _parse(layout: JointLayout, file: Path, rows: Iterator[list[str]]) -> EffortSeries:
    header, first = next(rows, []), next(rows, None)
    if header[:1] != [TIME_COLUMN] or first is None:
        raise EffortSeriesError(
            f"{file}: not a series of efforts; it must be CSV with a header '{TIME_COLUMN}' and "
            "names of degrees of freedom, and one row or more"
        )
    try:
        entries = layout.indices(tuple(header[1:]))
    except LayoutError as error:
        raise EffortSeriesError(f"{file}: {error}") from error
    numbers = _numbers(file, chain([first], rows), len(header))
    times = numbers[:, 0]
    efforts = np.zeros((len(numbers), layout.size))
    efforts[:, entries] = numbers[:, 1:]
    last = times[-1] - times[-2] if len(times) > 1 else np.inf
    return EffortSeries(np.append(times, times[-1] + last), efforts)


def _numbers(file: Path, rows: Iterable[list[str]], columns: int) -> FloatArray:
    """The numbers (t, columns) of the rows below the header, times first."""
    numbers = array("d")  # takes less memory than a list: a file of a few MB has many rows
    for line, row in enumerate(rows, start=2):
        try:
            values = [float(text) for text in row]
        except ValueError:
            values = []
        if len(values) != columns:
            raise EffortSeriesError(f"{file}, line {line}: it must hold {columns} numbers")
        if not all(map(math.isfinite, values)):
            raise EffortSeriesError(f"{file}, line {line}: a number is not finite")
        if numbers and values[0] <= numbers[-columns]:
            raise EffortSeriesError(
                f"{file}, line {line}: time {values[0]:g} s does not rise; it must be later than "
                f"the {numbers[-columns]:g} s of the line before"
            )
        numbers.extend(values)
    return np.array(numbers).reshape(-1, columns)
