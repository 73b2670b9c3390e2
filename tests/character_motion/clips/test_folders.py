"""Folders of clips: as the library of reactions, and as what a steered character moves by."""

from pathlib import Path

import pytest

from character_motion.clips.editing import loop
from character_motion.clips.importing import import_bvh
from character_motion.clips.motion_clip import read_motion_clip
from character_motion.retargeting.target_body import TargetBody
from controller_node.behaviours.motion_library import MotionLibrary
from controller_node.parameters import PARAMETERS
from controller_node.references.factory import make_motion
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from msgs_config.clips.reading import expand_clips
from msgs_config.errors import ActuatedCharactersError
from msgs_config.parameters import resolve
from tests.support.capture_makers import MAKERS
from tests.support.captures import capture
from tests.support.physics import character

HUMANOID = character("humanoid")


@pytest.fixture(scope="module")
def cycles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk and a run that were captured, imported, and made to go on."""
    folder = tmp_path_factory.mktemp("cycles")
    for clip in ("walk", "run"):
        made = import_bvh(
            capture(folder / f"{clip}.bvh", MAKERS["biovision"], clip), TargetBody(HUMANOID)
        ).clip
        loop(made, 0.0, made.duration).write(folder / f"{clip}.json")
    return folder


def steered(*clips: object) -> SteeredReference:
    names = [str(clip) for clip in clips]
    given = {"reference": "steered", "steering.clips": names, "steering.timeout": 1000.0}
    reference = make_motion(HUMANOID, resolve(PARAMETERS, given)).reference
    assert isinstance(reference, SteeredReference)
    return reference


def test_names_files_and_folders_are_clips(cycles: Path) -> None:
    (cycles / "LICENCE.txt").write_text("Everybody may use these clips.\n")
    files = [str(cycles / "run.json"), str(cycles / "walk.json")]

    assert expand_clips(HUMANOID, ["kick", str(cycles), files[1]]) == ["kick", *files]


def test_a_folder_is_a_library(cycles: Path) -> None:
    library = MotionLibrary(HUMANOID, ["kick", str(cycles)], lasting=0.5)

    assert {Path(str(clip)).name for clip in library.clips} == {"kick", "run.json", "walk.json"}
    frames = read_motion_clip(HUMANOID, str(cycles / "walk.json"))
    assert library.duration(str(cycles / "walk.json")) == pytest.approx(frames.duration, abs=1e-4)


def test_a_character_is_steered_by_the_clips_of_a_folder(cycles: Path) -> None:
    reference = steered(cycles)  # `run` comes before `walk`; their speeds decide

    fast = reference.steered(VelocityCommand(0, 2.0), 0).reference

    assert fast.course(10 * 240).forward == pytest.approx(2.0)
    assert fast.sample(8.0).configuration.position[0] > 10.0  # m


@pytest.mark.parametrize("clips", [["nowhere"], ["kick"], ["missing.json"]])
def test_what_is_no_clip_to_steer_by_is_rejected(clips: list[str]) -> None:
    with pytest.raises(ActuatedCharactersError, match=clips[0]):
        steered(*clips)


def test_what_is_no_library_is_rejected(tmp_path: Path) -> None:
    for clips, message in (
        ([str(tmp_path)], "there is no .json or .txt file of motion in it"),
        (["missing.json"], "unknown clip in parameter 'library': 'missing.json'"),
    ):
        with pytest.raises(ActuatedCharactersError, match=message) as caught:
            MotionLibrary(HUMANOID, clips, lasting=0.5)
        assert "\n" not in str(caught.value)
