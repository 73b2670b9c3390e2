"""The runs that can be the ghost of a recorded run."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, count

from actuated_characters.viewer.recorded.marks import Mark, find_marks
from actuated_characters.viewer.recorded.plots import RunCurves, run_curves
from actuated_characters.viewer.recorded.run import RecordedRun, beside

NO_GHOST, REFERENCE = "none", "reference"
"""What is chosen where no run is the ghost."""


@dataclass(frozen=True)
class Ghost:
    """Another run in the time of a run, and what the page shows of it beside its poses."""

    name: str
    run: RecordedRun
    marks: list[Mark]
    curves: Mapping[str, RunCurves]  # by the character


class Ghosts:
    """The other runs by their names."""

    def __init__(self, run: RecordedRun) -> None:
        self._run = run
        self._ghosts: dict[str, Ghost] = {}

    @property
    def names(self) -> list[str]:
        """Those of all ghosts."""
        return list(self._ghosts)

    def make(self, other: RecordedRun) -> Ghost:
        """Make a ghost of a run, which takes its time; for any thread.

        Raises:
            RecordingError: it has other characters.
            ActuatedCharactersError: its bag cannot be read.
        """
        name = self._free_name(other)
        run = beside(self._run, other)
        return Ghost(name, run, find_marks(run), run_curves(run, name))

    def add(self, ghost: Ghost) -> None:
        """Add one of those that were made."""
        self._ghosts[ghost.name] = ghost

    def _free_name(self, other: RecordedRun) -> str:
        """The name of a run's directory, or its path where something else is called so."""
        taken = {self._run.name, NO_GHOST, REFERENCE, *self._ghosts}
        path = str(other.path.resolve())
        numbered = (f"{path} ({number})" for number in count(2))
        names = chain((other.name, str(other.path), path), numbered)
        return next(name for name in names if name not in taken)

    def get(self, name: str) -> Ghost | None:
        """The ghost of a name; None if there is none."""
        return self._ghosts.get(name)
