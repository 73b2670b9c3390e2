"""What a URDF's links and joints are without any engine, and what is refused."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from msgs_config.character.loading import load_character
from msgs_config.errors import CharacterError
from tests.support.urdf import inertial, joint, link, refusal, robot, write_character

PROJECT = Path(__file__).parents[4]
MASS = '<mass value="1"/>'
MOMENTS = 'ixx="1" iyy="1" izz="1"'
INCOMPLETE = {
    "a mass without its value": (f"<inertial><mass/><inertia {MOMENTS}/></inertial>", "mass"),
    "an inertia without a moment": (
        f'<inertial>{MASS}<inertia ixx="1" iyy="1"/></inertial>',
        "inertia",
    ),
    "a contact without its value": (
        inertial() + "<contact><rolling_friction/></contact>",
        "rolling_friction",
    ),
}


@pytest.mark.parametrize("case", INCOMPLETE)
def test_an_element_without_its_number_is_refused(tmp_path: Path, case: str) -> None:
    inside, tag = INCOMPLETE[case]
    path = write_character(tmp_path, robot(link("a"), link("b", inside), joint("j", "a", "b")))

    line = refusal(path)

    assert f"{path.with_suffix('.urdf')}: not a usable URDF: <{tag}> of link 'b' has no " in line


def test_a_robot_without_a_name_is_refused(tmp_path: Path) -> None:
    path = write_character(tmp_path, f"<robot>{link('a')}</robot>")

    assert "not a usable URDF: <robot> has no 'name'" in refusal(path)


@pytest.mark.parametrize(("length", "is_refused"), [(7000, False), (9000, True)])
def test_an_element_too_long_for_an_engine_is_refused(
    tmp_path: Path, length: int, is_refused: bool
) -> None:
    path = write_character(tmp_path, f'<robot name="{"x" * length}">{link("a")}</robot>')

    if is_refused:
        assert "an element of more than 8000 bytes; the engine cannot read it" in refusal(path)
    else:
        assert load_character(str(path)).mass == 1.0


def test_branches_are_in_a_row_in_the_order_of_their_joints(tmp_path: Path) -> None:
    """Whatever the order of links, and of joints of different parents."""
    joints = [
        joint("second_hand", "second", "hand"),
        joint("base_first", "base", "first"),
        joint("base_second", "base", "second"),
        joint("first_tip", "first", "tip"),
    ]
    names = ("hand", "tip", "second", "base", "first")
    path = write_character(tmp_path, robot(*map(link, names), *joints))

    links = load_character(str(path)).links

    assert [each.name for each in links] == ["base", "first", "tip", "second", "hand"]
    assert [each.parent for each in links] == [-1, 0, 1, 0, 3]


def test_characters_are_read_and_modelled_without_an_engine_of_the_simulator() -> None:
    code = """
import sys
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.file import shipped_characters
from msgs_config.character.loading import load_character
for name in shipped_characters():
    DynamicsModel(load_character(name))
print(*sys.modules)
"""
    loaded = subprocess.run(
        [sys.executable, "-c", code],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout.split()

    assert not {"pybullet", "pybullet_data"} & set(loaded)


@pytest.mark.parametrize("name", ["humanoid", "package://pybullet_data/r2d2.urdf"])
def test_where_the_shipped_robots_are_not_installed_a_line_says_what_has_them(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda package: None)

    with pytest.raises(CharacterError) as caught:
        load_character(name)

    line = str(caught.value)
    assert "package 'pybullet_data' is not installed; it comes with PyBullet, and alone by" in line
    assert "\n" not in line
    assert load_character("pendulum").name == "pendulum"
