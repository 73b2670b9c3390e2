"""Axes, units, headings and first frames, found out of files of which they are known."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from character_motion.bvh.axes_and_units import AXES
from character_motion.bvh.reading import read_bvh
from character_motion.retargeting.conventions import (
    axis_vector,
    find_unit,
    quaternion,
    to_upright,
)
from character_motion.retargeting.retargeting import RetargetingSettings, read_body
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations
from tests.support.capture_makers import MAKERS
from tests.support.captures import X_UP, Y_UP, Z_UP, Maker, capture

CLIPS = ["walk", "run", "crawl", "cartwheel", "roll", "getup_facedown"]


def conventions_of(path: Path, maker: Maker, clip: str = "walk"):
    file = capture(path / "a.bvh", maker, clip)
    return read_body(file, read_bvh(file), RetargetingSettings())


@pytest.mark.parametrize(
    ("axis", "world", "clip"),
    [("x", X_UP, "walk"), *((a, w, clip) for a, w in (("y", Y_UP), ("z", Z_UP)) for clip in CLIPS)],
)
def test_up_is_found_whatever_the_body_does(
    tmp_path: Path, axis: str, world: np.ndarray, clip: str
) -> None:
    maker = replace(MAKERS["mixamo"], world=world, rest=Y_UP)

    _, conventions = conventions_of(tmp_path, maker, clip)

    assert conventions.up == axis


@pytest.mark.parametrize(
    ("unit", "name"),
    [(1.0, "m"), (0.01, "cm"), (0.001, "mm"), (0.0254, "inches"), (0.3048, "feet")],
)
def test_a_unit_is_that_in_which_a_leg_is_human(tmp_path: Path, unit: float, name: str) -> None:
    body, conventions = conventions_of(tmp_path, replace(MAKERS["rokoko"], unit=unit))

    assert conventions.unit == name and conventions.unit_length == unit
    assert body.leg_length == pytest.approx(
        0.83, abs=1e-3
    )  # the thigh and shank that it was made of


def test_a_unit_that_fits_no_human_is_made_to_fit() -> None:
    assert find_unit(14.7)[0] == "?"  # as CMU's, of 5.6 cm
    assert find_unit(14.7)[1] * 14.7 == pytest.approx(0.82)


@pytest.mark.parametrize("yaw", [-2.5, -0.4, 0.0, 1.2, 3.0])
def test_a_body_faces_along_x_at_first_however_the_file_is_turned(
    tmp_path: Path, yaw: float
) -> None:
    straight, _ = conventions_of(tmp_path, MAKERS["rokoko"])
    body, conventions = conventions_of(tmp_path, replace(MAKERS["rokoko"], yaw=yaw))

    relative = [each.positions - each.positions[:1, :1] for each in (straight, body)]
    np.testing.assert_allclose(relative[1], relative[0], atol=1e-5)
    assert math.cos(conventions.heading - yaw) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize("maker", ["cmu", "daz"])
def test_a_pose_that_was_put_first_is_left_out(tmp_path: Path, maker: str) -> None:
    with_pose, conventions = conventions_of(tmp_path, MAKERS[maker])
    without, none = conventions_of(tmp_path, replace(MAKERS[maker], first_rest=False))

    assert (conventions.first_frame, none.first_frame) == (1, 0)
    np.testing.assert_allclose(with_pose.positions, without.positions, atol=1e-9)


@pytest.mark.parametrize(("maker", "name"), [("cmu", "T"), ("rokoko", "A"), ("lafan", "none")])
def test_the_pose_at_rest_is_named(tmp_path: Path, maker: str, name: str) -> None:
    assert conventions_of(tmp_path, MAKERS[maker])[1].rest == name


def test_sides_that_are_named_the_other_way_round_are_exchanged(tmp_path: Path) -> None:
    maker = MAKERS["mixamo"]
    swap = str.maketrans({"<": "Left", ">": "Right"})
    names = {
        part: name.replace("Left", ">").replace("Right", "<").translate(swap)
        for part, name in maker.names.items()
    }

    body, conventions = conventions_of(tmp_path, replace(maker, names=names))
    right, _ = conventions_of(tmp_path, maker)

    assert conventions.sides_swapped and "exchanged" in conventions.described()
    np.testing.assert_allclose(body.part("left_hip"), right.part("left_hip"), atol=1e-9)


def test_feet_say_where_a_body_goes_whose_root_stands_still(tmp_path: Path) -> None:
    moving, known = conventions_of(tmp_path, replace(MAKERS["in place"], root_moves=True))
    body, conventions = conventions_of(tmp_path, MAKERS["in place"])

    way = [np.ptp(each.middle("hip")[:, 0]) for each in (moving, body)]
    assert known.root_moves and not conventions.root_moves
    assert way[1] == pytest.approx(way[0], rel=0.1)


def test_a_single_pose_is_no_motion(tmp_path: Path) -> None:
    file = capture(tmp_path / "a.bvh", MAKERS["rokoko"], change=lambda values: values[:1])

    with pytest.raises(ClipError, match="1 frame; a motion needs two or more"):
        read_body(file, read_bvh(file), RetargetingSettings())


@pytest.mark.parametrize("axis", AXES)
def test_every_axis_is_led_up(axis: str) -> None:
    turn = to_upright(axis)

    np.testing.assert_allclose(rotations.rotate(turn, axis_vector(axis)), (0, 0, 1), atol=1e-12)


def test_a_quaternion_has_its_matrix() -> None:
    rng = np.random.default_rng(2)
    turns = rng.normal(size=(200, 4))
    turns[:3] = np.eye(4)[:3]  # half turns
    turns = rotations.normalised(turns)

    again = quaternion(rotations.matrix(turns))

    np.testing.assert_allclose(np.abs((again * turns).sum(axis=-1)), 1.0, atol=1e-12)
