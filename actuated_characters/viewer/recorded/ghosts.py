"""The runs that can be the ghost of a recorded run."""

from collections.abc import Mapping
from dataclasses import dataclass

from actuated_characters.viewer.recorded.marks import Mark, find_marks
from actuated_characters.viewer.recorded.plots import RunCurves, run_curves
from actuated_characters.viewer.recorded.run import RecordedRun, beside


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

    def add(self, other: RecordedRun) -> Ghost:
        """Add a run.

        Raises:
            RecordingError: it has other characters.
            ActuatedCharactersError: its bag cannot be read.
        """
        name = other.name if other.name != self._run.name else str(other.path)
        run = beside(self._run, other)
        self._ghosts[name] = Ghost(name, run, find_marks(run), run_curves(run, name))
        return self._ghosts[name]

    def get(self, name: str) -> Ghost | None:
        """The ghost of a name; None if there is none."""
        return self._ghosts.get(name)
