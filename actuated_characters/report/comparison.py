"""Two recordings side by side, tick by tick and to the last bit."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics import error_measures
from actuated_characters.metrics.recording_metrics import measure_recording
from actuated_characters.render.plots import label, make_panels
from actuated_characters.report.decimation import decimated
from actuated_characters.report.events import differences
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import RecordingError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock

if TYPE_CHECKING:  # it takes a while to import
    from matplotlib.figure import Figure

_PANEL = (11.0, 3.4)  # inches, of each character's panel
_LOG_ZERO = 1e-17  # rad or m; stands for 0 on a logarithmic axis
_QUANTITIES = ("effort", "position", "velocity")  # by cause: a state's effort came before it


@dataclass(frozen=True)
class FirstDifference:
    """The first difference of two recordings."""

    tick: int  # tick of the state that differs
    time: float  # s since the first state that both have
    quantity: str  # "effort" of the tick before, "position" or "velocity"
    dof: str  # the degree of freedom that differs most
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
        seconds, first_rows = np.unique(np.floor(self.times + 1e-9), return_index=True)
        columns = np.stack((self.joints, self.sliders, self.root), axis=1)
        largest = np.fmax.reduceat(columns, first_rows)
        return list(zip(seconds.tolist(), *largest.T.tolist(), strict=True))


@dataclass(frozen=True)
class RecordingComparison:
    """The differences of two recordings of one character."""

    name: str
    states: tuple[int, int]  # states of each recording
    common: int  # states with the same stamps
    first: FirstDifference | None
    growth: Growth
    metrics: dict[str, tuple[object, object]]  # of both recordings, without those that neither has
    simulator: dict[str, tuple[object, object]]  # parameters that differ
    controller: dict[str, tuple[object, object]] | None  # those at the start; None: not in both
    versions: dict[str, tuple[object, object]]  # of package, engines and libraries that differ

    @property
    def identical(self) -> bool:
        """Whether both have the same states, and no others."""
        return self.first is None and self.states == (self.common, self.common)


def draw_comparisons(comparisons: list[RecordingComparison]) -> "Figure":
    """One panel a character: the difference of joints, sliders and root over time."""
    width, height = _PANEL
    figure, panels = make_panels(len(comparisons), 1, (width, height * len(comparisons)))
    for panel, comparison in zip(panels, comparisons, strict=True):
        growth = comparison.growth
        curves = {
            "joints, largest (rad)": growth.joints,
            "sliders, largest (m)": growth.sliders,
            "root (m)": growth.root,
        }
        known = {name: values for name, values in curves.items() if not np.isnan(values).all()}
        for name, values in known.items():
            times, drawn = decimated(growth.times, np.maximum(values, _LOG_ZERO)[:, np.newaxis])
            panel.plot(times, drawn[:, 0], linewidth=0.9, label=name)
        if comparison.first is not None:
            time = comparison.first.time
            panel.axvline(time, color="black", linestyle=":", label="first difference")
        panel.set_yscale("log")
        panel.set_ylim(bottom=_LOG_ZERO)
        legend = "lower right" if known or comparison.first is not None else None
        label(panel, "simulation time (s)", "difference", comparison.name, legend=legend)
    return figure


_Rows: TypeAlias = tuple[Recording, IntArray]
"""A recording, and its rows (c,) of the states that both recordings have."""


def compare(
    first: Recording, second: Recording, tolerance: float | None = None
) -> RecordingComparison:
    """Compare two recordings wherever they have states with the same stamps.

    Args:
        first: One.
        second: The other.
        tolerance: How far apart numbers may be and count as the same: rad, m, rad/s, m/s, N m
            or N, and so many parts of those that are larger than 1. None: to the last bit.

    Raises:
        RecordingError: they are of different characters, or have no stamp in common.
    """
    both = (first, second)
    if first.layout.joints != second.layout.joints:
        named = [f"'{r.character.name}' ({r.layout.size} degrees of freedom)" for r in both]
        raise RecordingError(f"the recordings are of different characters: {' and '.join(named)}")
    stamps, ours, theirs = np.intersect1d(
        first.stamps_ns, second.stamps_ns, assume_unique=True, return_indices=True
    )
    if not len(stamps):
        spans = [f"{r.stamps_ns[0]} to {r.stamps_ns[-1]} ns" for r in both]
        raise RecordingError(f"the recordings have no stamp in common: {' and '.join(spans)}")
    measured = [measure_recording(recording)[0] for recording in both]
    metrics = {name: (value, measured[1][name]) for name, value in measured[0].items()}
    told = [r.controller[0].parameters if r.controller else {} for r in both]
    return RecordingComparison(
        name=first.name,
        states=(len(first.stamps_ns), len(second.stamps_ns)),
        common=len(stamps),
        first=_first_difference((first, ours), (second, theirs), tolerance),
        growth=_growth((first, ours), (second, theirs)),
        metrics={name: values for name, values in metrics.items() if values != (None, None)},
        simulator=differences(first.parameters, second.parameters),
        controller=differences(*told) if all(told) or not any(told) else None,
        versions=differences(first.versions, second.versions),
    )


def pair(
    first: tuple[Recording, ...], second: tuple[Recording, ...]
) -> list[tuple[Recording, Recording]]:
    """Pair the recordings of two bags by name; one recording each is a pair whatever its name.

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


def _first_difference(
    first: _Rows, second: _Rows, tolerance: float | None
) -> FirstDifference | None:
    """The first row that differs, and there the degree of freedom that differs most."""
    (recording, rows), earliest = first, None
    for quantity in _QUANTITIES:
        ours, theirs = _values(first, quantity), _values(second, quantity)
        for each, its_rows in (first, second):
            if quantity == "effort" and each.keyframe is not None:
                ours[its_rows == 0] = theirs[its_rows == 0] = np.nan  # that is in the bag before
        differs = error_measures.different_bits(ours, theirs)
        if not differs.any():
            continue
        amounts = _amounts(recording, quantity, ours, theirs)
        if tolerance is not None:
            differs &= ~(amounts <= tolerance * np.maximum(1.0, np.abs(ours)))  # NaN differs
        found = np.flatnonzero(differs.any(axis=1))
        if not len(found) or (earliest is not None and found[0] >= earliest[0]):
            continue
        row = int(found[0])
        amount = np.where(differs[row], np.nan_to_num(amounts[row], nan=np.inf), -1.0)
        worst = int(amount.argmax())
        stamp = int(recording.stamps_ns[rows[row]])
        earliest = (
            row,
            FirstDifference(
                tick=TickClock(int(recording.parameters["rate"])).first_tick_from(stamp),
                time=(stamp - int(recording.stamps_ns[rows[0]])) / NANOSECONDS_PER_SECOND,
                quantity=quantity,
                dof=recording.layout.dof_names[worst],
                values=(float(ours[row, worst]), float(theirs[row, worst])),
                amount=float(amount[worst]),
                count=int(differs[row].sum()),
            ),
        )
    return None if earliest is None else earliest[1]


def _values(of: _Rows, quantity: str) -> FloatArray:
    """A quantity (c, n) of some states; a state's effort is that of the tick before."""
    recording, rows = of
    if quantity == "position":
        return recording.position[rows]
    if quantity == "velocity":
        return recording.velocity[rows]
    return np.vstack((np.full((1, recording.layout.size), np.nan), recording.effort))[rows]


def _amounts(
    recording: Recording, quantity: str, ours: FloatArray, theirs: FloatArray
) -> FloatArray:
    """The sizes (c, n) of the differences of two arrays."""
    if quantity == "position":
        return np.abs(error_measures.differences(recording.layout, ours, theirs))
    return np.abs(theirs - ours)


def _growth(first: _Rows, second: _Rows) -> Growth:
    recording, rows = first
    ours, theirs = _values(first, "position"), _values(second, "position")
    apart = error_measures.distances(recording.layout, ours, theirs)
    # equal positions are 0 apart, although a rotation's logarithm leaves rounding errors
    apart[~error_measures.different_bits(ours, theirs).any(axis=1)] = 0.0
    kinds, stamps = error_measures.vector_kinds(recording.layout), recording.stamps_ns[rows]
    unknown = np.full((len(apart), 1), np.nan)  # for characters without a joint of the kind

    def largest(chosen: BoolArray) -> FloatArray:
        values: FloatArray = np.fmax.reduce(np.hstack((unknown, apart[:, chosen])), axis=1)
        return values

    is_first = np.arange(apart.shape[1]) == 0
    return Growth(
        times=(stamps - stamps[0]) / NANOSECONDS_PER_SECOND,
        joints=largest(kinds.rotating),
        sliders=largest(kinds.sliding),
        root=largest(is_first & ~kinds.actuated),
    )
