"""The labs by name."""

from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from lecture.labs.sheet import Sheet
from lecture.labs.student import Student

LABS = {
    "lab1": "spring",
    "lab2": "stable_pd",
    "lab3": "balance",
    "lab4": "simbicon",
    "lab5": "samcon",
    "lab6": "planner",
}
_STUBS = Path(__file__).parent / "stubs"


class Lab(Protocol):
    """A module of `exercises`."""

    TITLE: str

    def grade(self, student: Student, sheet: Sheet) -> None:
        """Have all criteria judged."""
        ...


def load_lab(name: str) -> Lab:
    """The exercise of a name."""
    return cast(Lab, import_module(f"lecture.labs.exercises.{LABS[name]}"))


def stub_of(name: str) -> bytes:
    """The file that a student begins with."""
    return (_STUBS / f"{name}.py").read_bytes()
