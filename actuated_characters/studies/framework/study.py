"""What a study is: runs that are asked for one by one, and what was found by them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from actuated_characters.bags.recording import Recording
from actuated_characters.runs.planned_wrenches import PlannedPush
from msgs_config.arrays import FloatArray

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.figure import Figure

Cell = str | int | float | bool | None
"""What a table's field holds; None where nothing can be said."""


@dataclass(frozen=True)
class RunSpec:
    """One run of a study: what `actuated_characters run` takes."""

    label: str  # unique in its study; also the name of its directory
    character: str  # a shipped one, or a file's path
    duration: float  # s
    reference: Mapping[str, object] = field(default_factory=dict)  # `reference`, `clip`, ...
    simulator: Mapping[str, object] = field(default_factory=dict)  # parameters of sim_node
    controller: Mapping[str, object] = field(default_factory=dict)  # of controller_node
    pushes: Sequence[PlannedPush] = ()  # each for the simulator's `wrench_duration`
    throws: Sequence[str] = ()  # as `--throw` has them
    contacts: bool = False  # whether to record them


@dataclass(frozen=True)
class RunResult:
    """What a run gave."""

    recording: Recording
    summary: Mapping[str, object]  # of summary.json
    diverged: str = ""  # why it ended before its time; "" if it did not


class StudyRunner(Protocol):
    """Where runs are made."""

    def run(self, case: RunSpec) -> RunResult:
        """Run a case over topics, to its end or until it diverges.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or a process failed.
        """
        ...

    def write(self, name: str, text: str) -> str:
        """Write a file that runs need, such as a URDF, below the study; returns its path."""
        ...


@dataclass(frozen=True)
class StudyResult:
    """A table, pictures, and the curves behind them."""

    columns: Sequence[str]  # with their units
    rows: Sequence[Sequence[Cell]]
    figures: Mapping[str, "Figure"]  # by the name of their files
    curves: Mapping[str, tuple[Sequence[str], FloatArray]] = field(default_factory=dict)
    # by the name of a CSV file: column names, and an array with a column for each
    notes: Sequence[str] = ()  # sentences that say what is seen


class Study(Protocol):
    """One of the lecture's topics."""

    name: str
    title: str  # one line
    runs: int  # how many it asks for, about; for the progress bar

    def run(self, runner: StudyRunner) -> StudyResult:
        """Run its cases and say what was found."""
        ...
