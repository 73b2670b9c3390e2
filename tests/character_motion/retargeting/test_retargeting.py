"""Ten files of ten makers, imported without settings: what they show, and how their feet stand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.cli import main
from character_motion.bvh.reading import read_bvh
from character_motion.clips.importing import ImportedClip, import_bvh
from character_motion.retargeting.optimisation import inverse_kinematics
from character_motion.retargeting.target_body import TargetBody
from controller_node.references.clip import ClipReference
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ClipError
from tests.support.capture_makers import MAKERS, TEN_FILES
from tests.support.captures import Maker, capture
from tests.support.physics import character

IN_GROUND, SKATING = 0.01, 0.02  # m and m/s: the bars


@pytest.fixture(scope="module")
def target() -> TargetBody:
    return TargetBody(character("humanoid"))


def imported(path: Path, target: TargetBody, maker: Maker, clip: str) -> ImportedClip:
    return import_bvh(capture(path / "a.bvh", maker, clip), target)


def errors(made: ImportedClip, clip: str, rows: slice = slice(None)) -> FloatArray:
    """How far (f, n) a motion is from the clip that the file was made of."""
    whole = made.clip.character
    frames = read_clip(whole, clip)
    times = np.minimum(made.clip.times[rows], 0.9999 * frames.times[-1])
    states = ClipReference(whole.layout, frames).samples(times.tolist())
    truth = GeneralizedPosition(
        np.array([state.configuration.position for state in states]),
        np.array([state.configuration.orientations_xyzw for state in states]),
    )
    motion = made.clip.motion
    own = GeneralizedPosition(motion.position[rows], motion.orientations_xyzw[rows])
    return whole.layout.difference(truth, own)


def check_bars(made: ImportedClip) -> None:
    quality = made.quality
    lower, upper = made.clip.character.position_bounds()
    assert quality.feet_in_ground_m <= IN_GROUND
    assert quality.skating_mean_m_s is None or quality.skating_mean_m_s <= SKATING
    assert (made.clip.motion.position >= lower).all()
    assert (made.clip.motion.position <= upper).all()


@pytest.mark.parametrize("maker", ["lafan", "biovision"])
def test_a_walk_is_the_walk_that_was_captured(
    tmp_path: Path, target: TargetBody, maker: str
) -> None:
    made = imported(tmp_path, target, MAKERS[maker], "walk")

    apart = np.abs(errors(made, "walk"))
    assert apart[:, 6:].mean() < 0.03 and np.percentile(apart[:, 6:], 99) < 0.15
    assert apart[:, 3:6].mean() < 0.03 and apart[:, :2].mean() < 0.03
    check_bars(made)


@pytest.mark.slow
@pytest.mark.parametrize(("maker", "clip"), TEN_FILES)
def test_ten_files_show_their_clips_with_feet_that_stand(
    tmp_path: Path, target: TargetBody, maker: str, clip: str
) -> None:
    made = imported(tmp_path, target, MAKERS[maker], clip)

    assert np.abs(errors(made, clip)[:, 6:]).mean() < 0.08
    assert made.worst_mean_rad < 0.25
    check_bars(made)


def test_the_makers_of_one_clip_agree(tmp_path: Path, target: TargetBody) -> None:
    one, other = (
        imported(tmp_path, target, replace(MAKERS[maker], rate=30.0), "walk")
        for maker in ("smpl", "course")
    )

    apart = one.clip.character.layout.difference(one.clip.motion, other.clip.motion)
    assert np.abs(apart[:, 6:]).mean() < 0.01


def test_an_import_is_the_same_each_time(tmp_path: Path, target: TargetBody) -> None:
    texts = [imported(tmp_path, target, MAKERS["biovision"], "kick").clip.text() for _ in range(2)]

    assert texts[0] == texts[1]


@pytest.mark.parametrize("rate", [24.0, pytest.param(240.0, marks=pytest.mark.nightly)])
def test_frames_come_at_the_file_s_own_rate(
    tmp_path: Path, target: TargetBody, rate: float
) -> None:
    made = imported(tmp_path, target, replace(MAKERS["course"], rate=rate), "walk")

    assert made.clip.rate == pytest.approx(rate, rel=1e-5)
    assert np.abs(errors(made, "walk")[:, 6:]).mean() < 0.03
    check_bars(made)


@pytest.mark.slow
def test_noise_of_a_degree_does_not_shake_the_body(tmp_path: Path, target: TargetBody) -> None:
    noisy = replace(MAKERS["rokoko"], noise=1.0)  # 100 frames a second: up to 2 rad/s each
    calm, shaken = (
        imported(tmp_path, target, maker, "walk") for maker in (MAKERS["rokoko"], noisy)
    )

    layout = calm.clip.character.layout
    assert np.abs(layout.difference(calm.clip.motion, shaken.clip.motion)[:, 6:]).mean() < 0.04
    assert shaken.quality.fastest_joint_rad_s < 1.5 * calm.quality.fastest_joint_rad_s
    check_bars(shaken)


def test_two_frames_are_a_motion(tmp_path: Path, target: TargetBody) -> None:
    file = capture(tmp_path / "a.bvh", MAKERS["lafan"], "walk", lambda values: values[:2])

    assert len(import_bvh(file, target).clip.times) == 2


@pytest.mark.nightly
@pytest.mark.slow
def test_a_long_file_solved_in_windows_is_the_same_as_solved_at_once(
    tmp_path: Path, target: TargetBody, monkeypatch: pytest.MonkeyPatch
) -> None:
    maker = replace(MAKERS["course"], rate=240.0)
    made = imported(tmp_path, target, maker, "cartwheel")
    monkeypatch.setattr(inverse_kinematics, "_WINDOW", 10_000)
    at_once = imported(tmp_path, target, maker, "cartwheel")

    layout = made.clip.character.layout
    apart = layout.difference(made.clip.motion, at_once.clip.motion)
    assert len(apart) > 600 and np.abs(apart).max() < 5e-3
    check_bars(made)


def test_a_file_of_the_own_skeleton_is_taken_as_it_is(tmp_path: Path, target: TargetBody) -> None:
    file = tmp_path / "own.bvh"
    assert main(["export", "kick", "--output", str(file), "--units", "cm"]) == 0

    made = import_bvh(file, target)

    assert made.retargeted.conventions.is_own
    assert np.abs(errors(made, "kick", slice(-1))).max() < 1e-5
    assert "own skeleton" in made.retargeted.conventions.described()


def test_a_body_without_legs_is_none(tmp_path: Path, target: TargetBody) -> None:
    file = capture(tmp_path / "a.bvh", MAKERS["course"])
    flat = file.read_text().replace("0.390000", "0.000000").replace("0.400000", "0.000000")
    file.write_text(flat)

    with pytest.raises(ClipError, match=r"a\.bvh: the legs have no length"):
        import_bvh(file, target)


@pytest.mark.parametrize("name", ["laikago", "kuka"])
def test_a_character_that_does_not_stand_on_two_legs_is_refused(name: str) -> None:
    with pytest.raises(ClipError, match=f"character '{name}'"):
        TargetBody(character(name))


def test_the_map_of_joints_is_kept_in_the_clip(tmp_path: Path, target: TargetBody) -> None:
    file = capture(tmp_path / "a.bvh", MAKERS["lafan"])
    made = import_bvh(file, target, licence="CC-BY 4.0")

    assert made.clip.source["licence"] == "CC-BY 4.0"
    assert made.clip.source["joints"]["left_knee"] == "LeftLeg"
    assert len(made.clip.source["sha256"]) == 64
    assert read_bvh(file).values.shape[0] == made.clip.source["frames"]
