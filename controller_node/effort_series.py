"""Efforts over time, recorded or computed: what the law `feedforward` applies."""

import csv
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import EffortSeriesError, LayoutError
from msgs_config.files import read_text
from msgs_config.joint_layout import JointLayout

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

    Those that have no column get no effort. The last row acts as long as the one before it.

    Raises:
        EffortSeriesError: names the file, the line and what would be right.
    """
    file = Path(path)
    lines = read_text(file, EffortSeriesError).splitlines()
    rows = list(csv.reader(lines))
    if len(rows) < 2 or rows[0][:1] != [TIME_COLUMN]:
        raise EffortSeriesError(
            f"{file}: not a series of efforts; it must be CSV with a header '{TIME_COLUMN}' and "
            "names of degrees of freedom, and one row or more"
        )
    try:
        entries = layout.indices(tuple(rows[0][1:]))
    except LayoutError as error:
        raise EffortSeriesError(f"{file}: {error}") from error
    numbers = _numbers(file, rows)
    times = numbers[:, 0]
    if not (np.diff(times) > 0.0).all():
        line = int(np.argmin(np.diff(times) > 0.0)) + 3
        raise EffortSeriesError(f"{file}, line {line}: time {times[line - 2]:g} s does not rise")
    efforts = np.zeros((len(numbers), layout.size))
    efforts[:, entries] = numbers[:, 1:]
    last = times[-1] - times[-2] if len(times) > 1 else np.inf
    return EffortSeries(np.append(times, times[-1] + last), efforts)


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


def _numbers(file: Path, rows: Sequence[Sequence[str]]) -> FloatArray:
    numbers = np.empty((len(rows) - 1, len(rows[0])))
    for index, row in enumerate(rows[1:]):
        try:
            numbers[index] = [float(text) for text in row]
        except ValueError as error:
            raise EffortSeriesError(
                f"{file}, line {index + 2}: it must hold {len(rows[0])} numbers"
            ) from error
    if not np.isfinite(numbers).all():
        line = int(np.argmin(np.isfinite(numbers).all(axis=1))) + 2
        raise EffortSeriesError(f"{file}, line {line}: a number is not finite")
    return numbers
