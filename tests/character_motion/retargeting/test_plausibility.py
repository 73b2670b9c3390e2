"""What speaks against a capture: bodies that are no human ones, and feet that float."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.cli import main
from character_motion.bvh.reading import read_bvh
from character_motion.clips.importing import import_bvh
from character_motion.retargeting.plausibility import doubts_of_human
from character_motion.retargeting.retargeting import RetargetingSettings, read_body
from character_motion.retargeting.target_body import TargetBody
from tests.support.capture_makers import MAKERS, TEN_FILES
from tests.support.captures import Floats, Proportions, capture
from tests.support.physics import character

DOG = Proportions(thigh=0.24, shank=0.22, spine=0.8, upper_arm=0.24, forearm=0.28)


def doubts(path: Path) -> tuple[str, ...]:
    return doubts_of_human(read_body(path, read_bvh(path), RetargetingSettings())[0])


@pytest.mark.parametrize(("maker", "clip"), TEN_FILES)
def test_there_is_no_doubt_about_people(tmp_path: Path, maker: str, clip: str) -> None:
    assert doubts(capture(tmp_path / "a.bvh", MAKERS[maker], clip)) == ()


def test_a_body_of_a_dog_is_doubted(tmp_path: Path) -> None:
    dog = replace(MAKERS["lafan"], proportions=DOG)

    found = doubts(capture(tmp_path / "a.bvh", dog, "crawl"))

    assert any("arm" in each for each in found) and any("trunk" in each for each in found)


def test_a_tail_is_doubted_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = capture(tmp_path / "a.bvh", MAKERS["lafan"], "walk", lambda values: values[:6])
    file.write_text(file.read_text().replace("LeftToe", "TailTip"))
    output = tmp_path / "a.json"

    assert main(f"motion import {file} --output {output} --no-picture".split()) == 0

    assert "remark: is this a human? a joint is called 'TailTip'" in capsys.readouterr().out
    assert "is this a human" in output.read_text()


def floated(values: Floats) -> Floats:
    values = values.copy()
    values[:, 1] += np.linspace(0.0, 30.0, len(values))  # cm, y up
    return values


@pytest.mark.slow
def test_a_capture_that_floats_gets_a_remark_and_is_put_on_the_ground(tmp_path: Path) -> None:
    target = TargetBody(character("humanoid"))
    maker = replace(MAKERS["bandai"], rate=30.0)
    calm = import_bvh(capture(tmp_path / "a.bvh", maker, "punch"), target)
    file = capture(tmp_path / "b.bvh", maker, "punch", floated)

    floating = import_bvh(file, target)
    grounded = import_bvh(file, target, RetargetingSettings(ground=True))

    assert any("the feet float by up to 0." in remark for remark in floating.remarks)
    assert not any("float" in remark for remark in (*calm.remarks, *grounded.remarks))
    assert floating.quality.standing_share < 0.7 * calm.quality.standing_share
    assert grounded.quality.standing_share > 0.85 * calm.quality.standing_share


def test_a_jump_is_no_floating(tmp_path: Path) -> None:
    target = TargetBody(character("humanoid"))

    made = import_bvh(capture(tmp_path / "a.bvh", MAKERS["rokoko"], "jump"), target)

    assert not any("float" in remark for remark in made.remarks)
