"""Grades of files that are made for a test."""

from pathlib import Path

from lecture.labs.catalogue import load_lab
from lecture.labs.sheet import Sheet
from lecture.labs.student import Student

_SOLUTIONS = Path(__file__).parent / "solutions"


def grade(lab: str, path: Path) -> Sheet:
    """The sheet of a file."""
    sheet = Sheet()
    with Student(path) as student:
        load_lab(lab).grade(student, sheet)
    return sheet


def solution(lab: str, *changes: tuple[str, str]) -> str:
    """Our solution's text, with some words of it changed; each of them is in it once."""
    text = (_SOLUTIONS / f"{lab}.py").read_text()
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text
