"""BVH as courses and makers write it, with poses worked out by hand, and files that are broken."""

import math
import re
import time
from pathlib import Path

import numpy as np
import pytest

from character_motion.bvh.kinematics import forward_kinematics, rest_positions
from character_motion.bvh.reading import MAX_BYTES, read_bvh
from character_motion.bvh.skeleton import EndSite
from msgs_config.errors import ClipError

ARM = """HIERARCHY
ROOT hip
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition ORDER
  JOINT arm
  {
    OFFSET 10 0 0
    CHANNELS 3 ORDER
    End Site
    {
      OFFSET 0 0 5
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
"""
ZXY = "Zrotation Xrotation Yrotation"
ZYX = "Zrotation Yrotation Xrotation"


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def arm(path: Path, order: str, *frames: str) -> Path:
    return write(path / "arm.bvh", ARM.replace("ORDER", order) + "\n".join(frames) + "\n")


def test_an_arm_in_zxy_is_where_the_hand_puts_it(tmp_path: Path) -> None:
    # root: 90 about z takes the arm (10, 0, 0) to (0, 10, 0), and the arm's 90 about x its end
    # (0, 0, 5) to (0, -5, 0), which the root turns to (5, 0, 0); shifted by (1, 2, 3)
    file = arm(tmp_path, ZXY, "1 2 3 90 0 0 0 90 0", "0 0 0 0 0 0 0 0 0")

    motion = read_bvh(file)
    poses = forward_kinematics(motion)

    assert motion.skeleton.names == ("hip", "arm") and motion.skeleton.parents == (-1, 0)
    assert motion.skeleton.end_sites == (EndSite(1, (0.0, 0.0, 5.0)),)
    assert motion.frame_time == 0.04 and motion.values.shape == (2, 9)
    np.testing.assert_allclose(poses.positions[0], [[1, 2, 3], [1, 12, 3]], atol=1e-12)
    np.testing.assert_allclose(poses.end_positions[0], [[6, 12, 3]], atol=1e-12)
    np.testing.assert_allclose(poses.end_positions[1], [[10, 0, 5]], atol=1e-12)


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        # z 90, then x 90, then y 90 of the turned axes: R = Rz Rx Ry; of (0, 0, 5), read from the
        # right: y takes it to (5, 0, 0), x leaves it, z takes it to (0, 5, 0)
        (ZXY, (0, 5, 0)),
        # R = Rz Ry Rx: x takes (0, 0, 5) to (0, -5, 0), y leaves it, z takes it to (5, 0, 0)
        (ZYX, (5, 0, 0)),
        # R = Rx Ry Rz: z leaves it, y takes it to (5, 0, 0), x leaves it
        ("Xrotation Yrotation Zrotation", (5, 0, 0)),
        # R = Ry Rx Rz: z leaves it, x takes it to (0, -5, 0), y leaves it
        ("Yrotation Xrotation Zrotation", (0, -5, 0)),
    ],
)
def test_each_order_of_channels_turns_by_hand(
    tmp_path: Path, order: str, expected: tuple[float, ...]
) -> None:
    still = "0 0 0 0 0 0"
    poses = forward_kinematics(
        read_bvh(arm(tmp_path, order, f"{still} 90 90 90", f"{still} 0 0 0"))
    )

    np.testing.assert_allclose(poses.end_positions[0, 0], np.add((10, 0, 0), expected), atol=1e-12)


def test_a_joint_goes_through_gimbal_lock_without_a_jump(tmp_path: Path) -> None:
    # pitch y from 60 to 120 degrees in ZYX; beyond 90 a writer has it as (180, 180 - y, 180)
    angles = np.linspace(60.0, 120.0, 61)
    rows = [f"0 0 0 0 0 0 {f'0 {y} 0' if y <= 90.0 else f'180 {180.0 - y} -180'}" for y in angles]
    file = arm(tmp_path, ZYX, *rows)
    file.write_text(file.read_text().replace("Frames: 2", "Frames: 61"))

    turns = forward_kinematics(read_bvh(file)).orientations_xyzw[:, 1]

    cosines = np.abs((turns[1:] * turns[:-1]).sum(axis=-1))
    np.testing.assert_allclose(2.0 * np.arccos(cosines), math.radians(1.0), atol=1e-7)
    assert ((turns[1:] * turns[:-1]).sum(axis=-1) > 0.99).all()


def test_positions_of_a_joint_stand_for_its_offset_or_add_to_it(tmp_path: Path) -> None:
    channels = "CHANNELS 3 ORDER\n    End"
    six = "CHANNELS 6 Xposition Yposition Zposition ORDER\n    End"
    text = ARM.replace(channels, six).replace("ORDER", ZXY)
    instead = write(tmp_path / "a.bvh", text + "0 0 0 0 0 0 10 0 0.1 0 0 0\n" * 2)
    added = write(tmp_path / "b.bvh", text + "0 0 0 0 0 0 0 0 0.1 0 0 0\n" * 2)

    for file in (instead, added):
        poses = forward_kinematics(read_bvh(file))
        np.testing.assert_allclose(poses.positions[0, 1], [10, 0, 0.1])


def test_rare_but_sound_forms_are_read(tmp_path: Path) -> None:
    text = ARM.replace("ORDER", ZXY).replace("ROOT hip\n{", "root Bip01 Pelvis {")
    text = text.replace("End Site", "End Site LeftToe")  # whose name says nothing
    text = "\ufeff" + text.replace("Xposition", "XPOSITION").replace("\n", "\t \r\n")

    file = write(tmp_path / "a.bvh", text + "\r\n0 0 0 0 0 0 0 0 1e1\r\n" * 2 + "\r\n\r\n")

    motion = read_bvh(file)
    assert motion.skeleton.names == ("Bip01 Pelvis", "arm")
    assert motion.values[1, -1] == 10.0
    np.testing.assert_array_equal(rest_positions(motion.skeleton), [[0, 0, 0], [10, 0, 0]])


SOUND = ARM.replace("ORDER", ZXY) + "0 0 0 0 0 0 0 0 0\n" * 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (SOUND, "", "the end of the file; there must be a hierarchy"),
        ("HIERARCHY", "hello", "line 1: 'hello'; there must be HIERARCHY: it is no BVH file"),
        ("MOTION\n", "", "'Frames: 2'; there must be one ROOT"),
        ("    CHANNELS 3", "    #", "line 9: '# Zrotation Xrotation Yrotation'; there must be"),
        (f"    CHANNELS 3 {ZXY}\n", "", "there must be CHANNELS in joint 'arm' of line 6"),
        ("CHANNELS 3", "CHANNELS 2", "there must be CHANNELS, their number"),
        ("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation", "line 9: unknown channel 'Wrotation'"),
        ("    OFFSET 10 0 0\n", "", "there must be OFFSET in joint 'arm' of line 6"),
        ("OFFSET 10 0 0", "OFFSET 10 nan 0", "line 8: 'OFFSET 10 nan 0'; there must be three"),
        ("JOINT arm", "JOINT", "line 6: 'JOINT'; there must be a name"),
        ("JOINT arm", "JOINT hip", "line 6: 'JOINT hip'; there must be a name that no other"),
        ("JOINT arm\n  {", "JOINT arm\n", "there must be { after the name"),
        ("MOTION", "ROOT b\n", "'ROOT b'; there must be one ROOT"),
        ("Frames: 2", "Frames: 3", "2 lines of frames; 'Frames:' says 3"),
        ("Frames: 2", "Frames: -1", "line 17: 'Frames: -1'; there must be a number of frames"),
        ("Frames: 2", "Frames: two", "'Frames: two'; there must be a number of frames"),
        ("Frame Time: 0.04", "Frame Time: 0", "there must be the time of a frame in s"),
        ("Frame Time: 0.04\n", "", "there must be 'Frame Time:' with a number"),
        ("0 0 0 0 0 0 0 0 0\n", "0 0 0 0 0 0 0 0\n", "line 19: 8 numbers in frame 0; the channe"),
        ("0 0 0 0 0 0 0 0 0\n", "0 0 nan 0 0 0 0 0 0\n", "line 19: 'nan'; there must be finite"),
        ("0 0 0 0 0 0 0 0 0\n", "0 0 0 1,5 0 0 0 0 0\n", "line 19: '1,5'; there must be finite"),
        ("0 0 0 0 0 0 0 0 0\n", "0 0 1e300 0 0 0 0 0 0\n", "'1e300'; there must be finite"),
    ],
)
def test_a_broken_file_is_one_clear_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SOUND
    file = write(tmp_path / "broken.bvh", SOUND.replace(old, new))

    with pytest.raises(ClipError, match=re.escape(message)) as caught:
        read_bvh(file)

    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_files_that_are_no_text_too_large_or_too_deep_end_soon(tmp_path: Path) -> None:
    binary, large, deep = (tmp_path / name for name in ("binary", "large", "deep"))
    binary.write_bytes(bytes(range(256)) * 100)
    with large.open("wb") as file:
        file.truncate(100_000_000)
    deep.write_text("HIERARCHY\nROOT a {" + "".join(f"\nJOINT b{k} {{" for k in range(100_000)))
    start = time.monotonic()

    for path, message in (
        (binary, "not a text file"),
        (large, f"larger than {MAX_BYTES >> 20} MiB"),
        (deep, "at most 1024 joints"),
        (tmp_path / "none.bvh", "No such file"),
        (tmp_path, "not a file"),
    ):
        with pytest.raises(ClipError, match=message):
            read_bvh(path)

    assert time.monotonic() - start < 5.0


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-8-sig", "utf-16"])
def test_names_in_other_encodings_are_read(tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "arm.bvh"
    text = ARM.replace("ORDER", ZXY).replace("arm", "K\xf6rper").replace("hip", "H\xfcfte")
    file.write_bytes((text + "0 0 0 0 0 0 0 0 0\n" * 2).encode(encoding))

    assert read_bvh(file).skeleton.names == ("H\xfcfte", "K\xf6rper")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.fbx", b"anything", "an FBX scene, not a BVH file; Blender makes a .bvh"),
        ("a.bvh", b"Kaydara FBX Binary  \x00", "an FBX scene, not a BVH file"),
        ("a.bvh", b"version https://git-lfs.github.com/spec/v1\n", "'git lfs pull'"),
        ("a.json", b"{}", "played by 'run --clip'"),
    ],
)
def test_another_format_is_said_with_what_to_do(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    file = tmp_path / name
    file.write_bytes(content)

    with pytest.raises(ClipError, match="not a BVH file") as caught:
        read_bvh(file)

    assert message in str(caught.value) and "\n" not in str(caught.value)
