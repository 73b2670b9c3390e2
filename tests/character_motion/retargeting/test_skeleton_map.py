"""Which joint is which: of all makers, of odd names by a file, and what is refused."""

from pathlib import Path

import pytest

from character_motion.bvh.reading import read_bvh
from character_motion.retargeting.skeleton_map import (
    ROLES,
    SIDES,
    find_map,
    other_side,
    read_map,
)
from msgs_config.errors import ClipError
from tests.support.capture_makers import MAKERS
from tests.support.captures import capture


@pytest.mark.parametrize("maker", MAKERS)
def test_the_joints_of_all_makers_are_found(tmp_path: Path, maker: str) -> None:
    skeleton = read_bvh(capture(tmp_path / "a.bvh", MAKERS[maker])).skeleton

    found = find_map("a.bvh", skeleton.names, skeleton.parents)

    names = MAKERS[maker].names
    for side in SIDES:
        for part in ("hip", "knee", "ankle", "toe", "collar", "shoulder", "elbow", "wrist"):
            role = f"{side}_{part}"
            assert (role in found) == (role in names), role
            if role in names:
                assert skeleton.names[found[role]] == names[role]
    assert skeleton.names[found["pelvis"]] == names["hips"]
    assert skeleton.names[found["chest"]] == MAKERS[maker].spine[-1]
    assert skeleton.names[found["head"]] == names.get("head", names["neck"])


# Heads of hierarchies as they are met with, each with its legs and arms by hand
CHAINS = [
    # a biped whose collars hang on its neck: its chest is what the neck hangs on
    (
        ["Bip01", "Bip01 Pelvis", "Bip01 Spine", "Bip01 Neck", "Bip01 L Clavicle",
         "Bip01 L UpperArm", "Bip01 L Forearm", "Bip01 R Clavicle", "Bip01 R UpperArm",
         "Bip01 R Forearm", "Bip01 Head", "Bip01 L Thigh", "Bip01 L Calf", "Bip01 L Foot",
         "Bip01 R Thigh", "Bip01 R Calf", "Bip01 R Foot"],
        [-1, 0, 1, 2, 3, 4, 5, 3, 7, 8, 3, 1, 11, 12, 1, 14, 15],
        {"pelvis": 1, "chest": 2, "neck": 3, "head": 10, "left_hip": 11, "right_elbow": 9},
    ),
    # thighs below a joint of the hip, and a leg in two halves with twist
    (
        ["hips", "lButtock", "lThighBend", "lThighTwist", "lShin", "lFoot", "rButtock",
         "rThighBend", "rThighTwist", "rShin", "rFoot", "chest", "lCollar", "lShldrBend",
         "lForearmBend", "rCollar", "rShldrBend", "rForearmBend", "head"],
        [-1, 0, 1, 2, 3, 4, 0, 6, 7, 8, 9, 0, 11, 12, 13, 11, 15, 16, 11],
        {"left_hip": 2, "left_knee": 4, "left_ankle": 5, "right_shoulder": 16, "chest": 11},
    ),
]  # fmt: skip


@pytest.mark.parametrize(("names", "parents", "expected"), CHAINS)
def test_the_tree_decides_where_names_do_not(
    names: list[str], parents: list[int], expected: dict[str, int]
) -> None:
    found = find_map("a.bvh", names, parents)

    assert {role: found[role] for role in expected} == expected


def test_odd_names_come_from_a_file(tmp_path: Path) -> None:
    names = ["a", *(f"{side}{part}" for side in "LR" for part in ("eg0", "eg1", "eg2"))]
    names += [f"{side}{part}" for side in "LR" for part in ("rm0", "rm1")]
    parents = [-1, 0, 1, 2, 0, 4, 5, 0, 7, 0, 9]
    file = tmp_path / "map.yaml"
    file.write_text(
        "\n".join(
            f"{side}_{part}: {side[0].upper()}{name}"
            for side in SIDES
            for part, name in zip(
                ("hip", "knee", "ankle", "shoulder", "elbow"),
                ("eg0", "eg1", "eg2", "rm0", "rm1"),
                strict=True,
            )
        )
    )

    with pytest.raises(ClipError, match=r"no joint found for left_hip.*--map.*joints: a, Leg0"):
        find_map("a.bvh", names, parents)
    found = find_map("a.bvh", names, parents, read_map(file).source)

    assert found["left_knee"] == 2 and found["right_elbow"] == 10 and found["pelvis"] == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("left_kne: a", "unknown key 'left_kne'; did you mean 'left_knee'"),
        ("left_knee: [a]", "left_knee is .*must be"),
        ("- a", "must hold a mapping"),
        ("{", "not valid YAML"),
    ],
)
def test_a_wrong_map_is_one_clear_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "map.yaml"
    file.write_text(text)

    with pytest.raises(ClipError, match=message) as caught:
        read_map(file)

    assert "\n" not in str(caught.value)


def test_a_map_that_names_no_joint_says_which_there_are() -> None:
    names, parents, _ = CHAINS[0]

    with pytest.raises(
        ClipError, match="map: left_knee: unknown joint 'Bip01 L Clf'; did you mean"
    ):
        find_map("a.bvh", names, parents, {"left_knee": "Bip01 L Clf"})


def test_the_other_side_of_a_role_is_its_counterpart() -> None:
    assert {other_side(other_side(role)) for role in ROLES} == set(ROLES)
    assert other_side("left_hip") == "right_hip" and other_side("neck") == "neck"
