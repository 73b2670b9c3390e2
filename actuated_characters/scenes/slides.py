"""The lecture's slides, and what there is to run for each of them."""

from dataclasses import dataclass
from pathlib import Path

import yaml

_FILE = Path(__file__).parent / "slides.yaml"


@dataclass(frozen=True)
class Slides:
    """Slides that follow one another, and what shows their content."""

    first: int
    last: int
    content: str
    scene: str = ""  # a name for `play --scene`; empty: none
    studies: tuple[str, ...] = ()  # names for `study`
    command: str = ""  # another command of `actuated_characters`
    why: str = ""  # there is nothing to run

    @property
    def numbers(self) -> str:
        """The numbers as text."""
        return str(self.first) if self.first == self.last else f"{self.first}-{self.last}"

    @property
    def commands(self) -> tuple[str, ...]:
        """What is to be run, without the program's name."""
        scenes = (f"play --scene {self.scene}",) if self.scene else ()
        others = (self.command,) if self.command else ()
        return (*scenes, *(f"study {name}" for name in self.studies), *others)


def lecture_slides() -> list[Slides]:
    """All slides in their order."""
    entries = yaml.safe_load(_FILE.read_text(encoding="utf-8"))
    found = []
    for entry in entries:
        first, last = entry.pop("slides")
        studies = tuple(entry.pop("studies", ()))
        found.append(Slides(first=first, last=last, studies=studies, **entry))
    return found
