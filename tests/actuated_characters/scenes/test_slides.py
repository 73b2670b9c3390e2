"""The lecture's slides: each has a scene, a study, a command or a reason, and all of them exist."""

import pytest

from actuated_characters.cli import main
from actuated_characters.scenes.scene import scene_names
from actuated_characters.scenes.slides import lecture_slides
from lecture.framework.catalogue import NAMES

LAST = 77


def test_every_slide_has_something_to_run_or_a_reason() -> None:
    numbers = [n for each in lecture_slides() for n in range(each.first, each.last + 1)]

    assert numbers == list(range(1, LAST + 1))
    assert all(bool(each.commands) != bool(each.why) for each in lecture_slides())


def test_all_scenes_and_studies_exist() -> None:
    slides = lecture_slides()

    assert {each.scene for each in slides} - {""} <= set(scene_names())
    assert {name for each in slides for name in each.studies} <= set(NAMES)


def test_the_list_has_a_row_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["play", "--lecture"]) == 0

    lines = capsys.readouterr().out.splitlines()
    firsts = [line.split("│")[1].strip() for line in lines if line.startswith("│")]
    assert [first for first in firsts if first] == [each.numbers for each in lecture_slides()]
