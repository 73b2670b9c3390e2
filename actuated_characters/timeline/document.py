"""A timeline in memory, and its file: edits, undo, and a file that always has the newest state.

    document = Document(Path("dance.yaml"), "character: humanoid\\n")
    document.apply(edits.add_pose(0, 1.0, {"right_elbow": 1.2}))
    document.undo()

Every edit is written at once, whole or not at all; so what ends the process loses nothing but the
steps that could be undone. Undoing all of them leaves the file as it was, byte for byte. An edited
file is written anew: comments, and how a hand has laid it out, are lost until then.
"""

from dataclasses import dataclass
from pathlib import Path

from actuated_characters.timeline import content as timeline
from actuated_characters.timeline.content import Content
from actuated_characters.timeline.edits import Edit
from msgs_config import files
from msgs_config.errors import MotionError
from msgs_config.whole_files import write_whole


@dataclass(frozen=True)
class _State:
    content: Content
    read: str | None = None  # as it was read; None of what was edited here

    @property
    def text(self) -> str:
        return timeline.dump(self.content) if self.read is None else self.read


class Document:
    """A timeline's file while it is edited."""

    def __init__(self, file: Path, template: str = "") -> None:
        """Read a file, or begin one with the text of a template, which the first edit writes.

        Raises:
            MotionError: the file cannot be read, or is no timeline.
        """
        self.file = file
        self._written: str | None = None
        if file.exists():
            self._written = _read(file)
        text = template if self._written is None else self._written
        self._states, self._row = [_State(timeline.parse(file, text), text)], 0

    @property
    def content(self) -> Content:
        """The newest content; not to be changed."""
        return self._states[self._row].content

    @property
    def text(self) -> str:
        """The text that the file has once something was edited."""
        return self._states[self._row].text

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to be undone."""
        return self._row > 0

    @property
    def can_redo(self) -> bool:
        """Whether an edit was undone that can be done again."""
        return self._row < len(self._states) - 1

    def apply(self, edit: Edit) -> bool:
        """Edit, and write the file; whether anything is another now.

        Raises:
            MotionError: the edit cannot be made, or another program has changed the file.
            RecordingError: the file cannot be written. After either nothing is edited.
        """
        changed = edit(self.content)
        if changed == self.content:
            return False
        state = _State(changed)
        self._write(state)
        self._take(state)
        return True

    def undo(self) -> bool:
        """Undo the last edit, and write the file; whether there was one. Raises as `apply` does."""
        return self._go(-1)

    def redo(self) -> bool:
        """Do again what was undone; whether there was anything. Raises as `apply` does."""
        return self._go(1)

    def read_again(self) -> bool:
        """Take over what another program has written, as an edit; whether it is another.

        Raises:
            MotionError: the file cannot be read, or is no timeline any more.
        """
        text = _read(self.file)
        if text == self.text:
            self._written = text
            return False
        state = _State(timeline.parse(self.file, text), text)
        self._take(state)
        self._written = text
        return True

    def _take(self, state: _State) -> None:
        """Be in another state; what was undone cannot be done again."""
        self._states = [*self._states[: self._row + 1], state]
        self._row += 1

    def _go(self, steps: int) -> bool:
        row = self._row + steps
        if not 0 <= row < len(self._states):
            return False
        self._write(self._states[row])
        self._row = row
        return True

    def _write(self, state: _State) -> None:
        there = _read(self.file) if self.file.exists() else None
        if there != self._written and there is not None:
            raise MotionError(f"{self.file} was changed by another program; read it again first")
        text = state.text
        write_whole(self.file, text)
        self._written = text


def _read(file: Path) -> str:
    """The text of a file with its own ends of lines."""
    files.read_text(file, MotionError)  # its limits, and its errors in one line
    return file.read_bytes().decode("utf-8")
