"""The takes of a timeline that is edited: which ones are seen, and the one that is being made."""

import time
from dataclasses import replace
from pathlib import Path

from actuated_characters.timeline.takes import Take, takes_of
from actuated_characters.viewer.controls.command_process import CommandProcess
from actuated_characters.viewer.drawing.sample import CharacterSample
from actuated_characters.viewer.recorded.run import RecordedRun, read_run
from actuated_characters.viewer.recorded.timeline import row_at
from msgs_config.arrays import FloatArray
from msgs_config.errors import MotionError

NO_TAKE = "none: the keys"
_SIMULATED = "simulated "


class ShownTakes:
    """The takes beside a file; a new one is made by the command `take`."""

    def __init__(self, file: Path) -> None:
        self._file, self._takes = file, takes_of(str(file))
        self._known = self._takes.all()
        self._chosen: Take | None = None
        self._origin: Take | None = None  # what the next one goes on from; None: the last one
        self._awaited = False  # whether the one that is being made is to be seen
        self._run: RecordedRun | None = None  # of the chosen one
        self._other: RecordedRun | None = None  # what it is compared with
        self._process: CommandProcess | None = None
        self._simulated = ""  # what it has said last of how far it is
        self._ready: CommandProcess | None = None  # for the next one, once there was one
        self._begun = 0.0
        self.version = 0
        """Another one after each change of what there is, or is seen."""

    @property
    def names(self) -> dict[str, str]:
        """The takes by what is said of them: the number, the one that it is of, the title."""
        return {_describe(take): take.name for take in self._known}

    @property
    def chosen(self) -> str:
        """What is said of the take that is seen."""
        return NO_TAKE if self._chosen is None else _describe(self._chosen)

    @property
    def run(self) -> RecordedRun | None:
        """The take that is seen; None: it is the keys."""
        return self._run

    def choose(self, label: str) -> None:
        """See another take. Raises ActuatedCharactersError if it cannot be read."""
        if label == self.chosen:
            return
        take = self._find(label)
        self._run = None if take is None else read_run(take.directory)
        self._chosen = self._origin = take
        self.version += 1

    def leave(self) -> None:
        """See the keys, as they are edited; the next take still goes on from the one left."""
        self._awaited = False
        if self._chosen is not None:
            self._run = self._chosen = None
            self.version += 1

    def compare(self, label: str) -> None:
        """See a take as an outline beside. Raises ActuatedCharactersError if it cannot be read."""
        take = self._find(label)
        self._other = None if take is None else read_run(take.directory)

    def _find(self, label: str) -> Take | None:
        name = self.names.get(label)
        return None if name is None else self._takes.find(name)

    def sample(self, at: float) -> CharacterSample | None:
        """What the take that is seen has at a time in s; None if it is the keys.

        Its reference is the take that it is compared with, if there is one.
        """
        if self._run is None:
            return None
        sample = self._run.sample(0, row_at(self._run.times, at))
        if self._other is None:
            return sample
        return replace(sample, reference=self._other.position_at(0, at))

    def position(self, at: float) -> FloatArray | None:
        """Where the character is in the take that is seen, (n,), message form."""
        return None if self._run is None else self._run.position_at(0, at)

    @property
    def making(self) -> float | None:
        """For how long a take has been made, s of wall time; None: none is."""
        return None if self._process is None else time.monotonic() - self._begun

    @property
    def simulated(self) -> str:
        """How far the take is that is being made, as its command says it; empty before it says."""
        if self._process is not None and self._process.last_line.startswith(_SIMULATED):
            self._simulated = self._process.last_line
        return self._simulated

    def simulate(self, title: str) -> None:
        """Begin to make a take of the file as it is, and see it, unless an edit comes first.

        It goes on from the one that is seen, or was until an edit; without one from the last.

        Raises:
            MotionError: there is no file yet, or one is being made.
        """
        if self._process is not None:
            raise MotionError("a take is being made; cancel it first")
        if not self._file.exists():
            raise MotionError("there is nothing to simulate yet; set a key first")
        arguments = ["take", str(self._file), f"--title={title}", "--progress"]
        if self._origin is not None:
            arguments += ["--of", self._origin.name]
        self._awaited = True
        self._process, self._begun = self._ready or CommandProcess(), time.monotonic()
        self._ready, self._simulated = None, ""
        self._process.begin(arguments)

    def cancel(self) -> None:
        """End the take that is being made."""
        if self._process is not None:
            self._process.cancel()
            self._process = None

    def close(self) -> None:
        """End all processes."""
        self.cancel()
        if self._ready is not None:
            self._ready.cancel()

    def advance(self) -> str | None:
        """See the take that was made, once it is; returns what was said of it, then."""
        process = self._process
        if process is None or not process.has_ended:
            return None
        self._process = None
        self._ready = CommandProcess()  # while what was made is looked at
        words, error = process.lines(), process.error
        process.cancel()
        before = {take.name for take in self._known}
        self._known = self._takes.all()
        self.version += 1
        new = [take for take in self._known if take.name not in before]
        if error or not new:
            return error or next((line for line in words if line.startswith("nothing")), "")
        said = "; ".join(line for line in words if line.startswith(("take ", "it falls")))
        if not self._awaited:
            self._origin = new[-1]
            return f"{said}; choose it in Seen"
        self.choose(_describe(new[-1]))
        return said


def _describe(take: Take) -> str:
    of = f", of {take.parent}" if take.parent else ""
    title = f": {take.title}" if take.title else ""
    return f"{take.name}{of}{title}"
