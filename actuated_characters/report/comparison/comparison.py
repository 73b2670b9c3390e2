"""Two recordings side by side, tick by tick and to the last bit."""

from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import distances
from actuated_characters.metrics.recording_metrics import measure_recording, vectors_of
from actuated_characters.report.changes import differences
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import RecordingError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock

_BLOCK = 8192  # rows that are compared together


@dataclass(frozen=True)
class FirstDifference:
    """Where two recordings are no longer the same."""

    tick: int  # whose state it is
    time: float  # s since the first state that both have
    quantity: str  # "effort" of the tick before, "position" or "velocity"
    dof: str  # the one that differs most
    values: tuple[float, float]
    amount: float  # rad, m, ...; of rotations the difference is a rotation
    count: int  # degrees of freedom that differ in this quantity


@dataclass(frozen=True)
class Growth:
    """How far two recordings are apart, at each common state."""

    times: FloatArray  # (c,) s
    joints: FloatArray  # (c,) rad, the largest of all hinges and ball joints; NaN without any
    sliders: FloatArray  # (c,) m
    root: FloatArray  # (c,) m; NaN for a fixed base

    def by_second(self) -> list[tuple[float, float, float, float]]:
        """The largest of joints, sliders and root in each second, after the second's begin."""
        rows = []
        seconds = np.floor(self.times + 1e-9)
        for second in np.unique(seconds).tolist():
            chosen = seconds == second
            largest = [
                _largest(values[chosen]) for values in (self.joints, self.sliders, self.root)
            ]
            rows.append((second, *largest))
        return rows


@dataclass(frozen=True)
class Comparison:
    """What two recordings of one character have in common, and what not."""

    name: str
    states: tuple[int, int]  # of each
    common: int  # states with the same stamps
    first: FirstDifference | None
    growth: Growth
    figures: dict[str, tuple[object, object]]
    simulator: dict[str, tuple[object, object]]  # parameters that differ
    controller: dict[str, tuple[object, object]] | None  # at the start; None: not both say them

    @property
    def identical(self) -> bool:
        """Whether both have the same states, and no others."""
        return self.first is None and self.states == (self.common, self.common)


@dataclass(frozen=True)
class _Rows:
    """States with the same stamps in both recordings."""

    first: IntArray  # (c,)
    second: IntArray  # (c,)


def compare(first: Recording, second: Recording, tolerance: float | None = None) -> Comparison:
    """Compare two recordings wherever they have states with the same stamps.

    Args:
        first: One.
        second: The other.
        tolerance: How far apart numbers may be and count as the same: rad, m, rad/s, m/s, N m
            or N, and so many parts of those that are larger than 1. None: to the last bit.

    Raises:
        RecordingError: they are of different characters, or have no stamp in common.
    """
    _check_same_character(first, second)
    _, ours, theirs = np.intersect1d(
        first.stamps_ns, second.stamps_ns, assume_unique=True, return_indices=True
    )
    if not len(ours):
        spans = [f"{r.stamps_ns[0]} to {r.stamps_ns[-1]} ns" for r in (first, second)]
        raise RecordingError(f"the recordings have no stamp in common: {' and '.join(spans)}")
    rows = _Rows(ours.astype(np.intp), theirs.astype(np.intp))
    own_figures, other_figures = measure_recording(first)[0], measure_recording(second)[0]
    return Comparison(
        name=first.name,
        states=(len(first.stamps_ns), len(second.stamps_ns)),
        common=len(ours),
        first=_first_difference(first, second, rows, tolerance),
        growth=_growth(first, second, rows),
        figures={name: (value, other_figures[name]) for name, value in own_figures.items()},
        simulator=differences(first.parameters, second.parameters),
        controller=_controller_differences(first, second),
    )


def pair(
    first: tuple[Recording, ...], second: tuple[Recording, ...]
) -> list[tuple[Recording, Recording]]:
    """The recordings of two bags that are to be compared: by name, or the only ones.

    Raises:
        RecordingError: the bags have characters of different names.
    """
    if len(first) == len(second) == 1:
        return [(first[0], second[0])]
    others = {recording.name: recording for recording in second}
    names = [recording.name for recording in first]
    if set(names) != set(others):
        raise RecordingError(
            f"the recordings have different characters: {', '.join(names)} and {', '.join(others)}"
        )
    return [(recording, others[recording.name]) for recording in first]


def _check_same_character(first: Recording, second: Recording) -> None:
    if first.layout.joints != second.layout.joints:
        both = [
            f"'{r.character.name}' ({r.layout.size} degrees of freedom)" for r in (first, second)
        ]
        raise RecordingError(f"the recordings are of different characters: {' and '.join(both)}")


def _controller_differences(
    first: Recording, second: Recording
) -> dict[str, tuple[object, object]] | None:
    if bool(first.controller) != bool(second.controller):
        return None
    if not first.controller:
        return {}
    return differences(first.controller[0].parameters, second.controller[0].parameters)


def _first_difference(
    first: Recording, second: Recording, rows: _Rows, tolerance: float | None
) -> FirstDifference | None:
    for start in range(0, len(rows.first), _BLOCK):
        block = _Rows(rows.first[start : start + _BLOCK], rows.second[start : start + _BLOCK])
        found = _in_block(first, second, block, tolerance)
        if found is not None:
            row, quantity, differs, amounts, values = found
            worst = int(np.where(differs, amounts, -1.0).argmax())
            stamp = int(first.stamps_ns[block.first[row]])
            since = stamp - int(first.stamps_ns[rows.first[0]])
            return FirstDifference(
                tick=TickClock(int(first.parameters["rate"])).first_tick_from(stamp),
                time=since / NANOSECONDS_PER_SECOND,
                quantity=quantity,
                dof=first.layout.dof_names[worst],
                values=(float(values[0][worst]), float(values[1][worst])),
                amount=float(amounts[worst]),
                count=int(differs.sum()),
            )
    return None


def _in_block(
    first: Recording, second: Recording, rows: _Rows, tolerance: float | None
) -> tuple[int, str, BoolArray, FloatArray, tuple[FloatArray, FloatArray]] | None:
    """The first row (of the block) that differs, in what, where (n,), by how much (n,)."""
    earliest = None
    for quantity in ("effort", "position", "velocity"):  # the effort came before the state
        ours, theirs = _of(first, rows.first, quantity), _of(second, rows.second, quantity)
        both_missing = np.isnan(ours) & np.isnan(theirs)
        differs = (ours.view(np.int64) != theirs.view(np.int64)) & ~both_missing
        if differs.any():
            amounts = _amounts(first, quantity, ours, theirs)
            if tolerance is not None:
                allowed = tolerance * np.maximum(1.0, np.abs(ours))
                differs &= ~(amounts <= allowed)  # NaN is not
            different_rows = np.flatnonzero(differs.any(axis=1))
            if len(different_rows) and (earliest is None or different_rows[0] < earliest[0]):
                row = int(different_rows[0])
                values = ours[row], theirs[row]
                amount = np.nan_to_num(amounts[row], nan=np.inf)
                earliest = row, quantity, differs[row], amount, values
    return earliest


def _of(recording: Recording, rows: IntArray, quantity: str) -> FloatArray:
    """A quantity (r, n) of some states; a state's effort is that of the tick before."""
    if quantity == "position":
        return recording.position[rows]
    if quantity == "velocity":
        return recording.velocity[rows]
    efforts = np.full((len(rows), recording.layout.size), np.nan)
    known = rows > 0
    efforts[known] = recording.effort[rows[known] - 1]
    return efforts


def _amounts(
    recording: Recording, quantity: str, ours: FloatArray, theirs: FloatArray
) -> FloatArray:
    """How far apart two arrays (r, n) are in each entry."""
    if quantity != "position":
        return np.abs(theirs - ours)
    layout = recording.layout
    return np.abs(layout.difference(layout.configuration(ours), layout.configuration(theirs)))


def _growth(first: Recording, second: Recording, rows: _Rows) -> Growth:
    vectors = vectors_of(first.character)
    turns = np.array([unit == "rad" for unit in vectors.units], dtype=np.bool_)
    ours, theirs = first.position[rows.first], second.position[rows.second]
    apart = distances(first.layout, ours, theirs)
    same = (ours.view(np.int64) == theirs.view(np.int64)).all(axis=1)
    apart[same] = 0.0  # and not what a rotation's way there and back leaves
    stamps = first.stamps_ns[rows.first]
    has_root = first.layout.has_floating_base
    return Growth(
        times=(stamps - stamps[0]) / NANOSECONDS_PER_SECOND,
        joints=_largest_by_row(apart[:, vectors.actuated & turns]),
        sliders=_largest_by_row(apart[:, vectors.actuated & ~turns]),
        root=apart[:, 0] if has_root else np.full(len(apart), np.nan),
    )


def _largest_by_row(values: FloatArray) -> FloatArray:
    if not values.shape[1]:
        return np.full(len(values), np.nan)
    largest: FloatArray = values.max(axis=1)
    return largest


def _largest(values: FloatArray) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if len(known) else float("nan")
