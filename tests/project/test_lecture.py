"""docs/lecture.md: what it points at is there, and every study is in it."""

import re
from pathlib import Path

from actuated_characters.scenes.slides import lecture_slides
from lecture.framework.catalogue import NAMES

PROJECT = Path(__file__).parents[2]
TEXT = (PROJECT / "docs/lecture.md").read_text("utf-8")
REMEDY = "docs/lecture.md needs a section of each study, with its command and its picture"


def test_every_picture_is_there() -> None:
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", TEXT)

    assert len(pictures) >= len(NAMES), REMEDY
    assert [name for name in pictures if not (PROJECT / "docs" / name).is_file()] == []


def test_every_study_is_in_it() -> None:
    assert [name for name in NAMES if f"study {name}`" not in TEXT] == [], REMEDY


def test_every_file_that_it_names_exists() -> None:
    files = re.findall(
        r"`((?:controller|sim)_node/[\w/]+\.py|actuated_characters/[\w/]+\.py)`", TEXT
    )

    assert len(files) > 5
    assert [file for file in files if not (PROJECT / file).is_file()] == []


def test_its_table_of_slides_is_that_of_the_command() -> None:
    rows = [
        f"| {each.numbers} | {each.content} | "
        + (", ".join(f"`{command}`" for command in each.commands) or each.why)
        + " |"
        for each in lecture_slides()
    ]

    assert "\n".join(rows) in TEXT, "docs/lecture.md needs these rows:\n" + "\n".join(rows)
