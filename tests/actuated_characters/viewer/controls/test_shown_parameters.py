"""The panel's parameters are ones that the nodes have, within their bounds."""

import pytest

from actuated_characters.viewer.controls.shown_parameters import (
    CONTROLLER,
    SIMULATOR,
    shown_parameters,
)
from controller_node.parameters import PARAMETERS as CONTROLLERS
from controller_node.parameters import character_parameters
from msgs_config.character.loading import load_character
from sim_node.parameters import PARAMETERS as SIMULATORS


@pytest.mark.parametrize("name", ["humanoid", "pendulum", "lift", "laikago"])
def test_each_shown_parameter_is_one_of_its_nodes(name: str) -> None:
    character = load_character(name)
    known = {
        CONTROLLER: {each.name: each for each in [*CONTROLLERS, *character_parameters(character)]},
        SIMULATOR: {each.name: each for each in SIMULATORS},
    }
    root = {"effort_limit.root", "effort_limit.root_r"}
    for shown in (each for folder in shown_parameters(character).values() for each in folder):
        for node in shown.nodes:
            if shown.name in root and not character.layout.has_floating_base:
                continue  # the panel hides what the node does not have
            parameter = known[node][shown.name]
            if shown.range is not None:
                assert parameter.minimum <= shown.range[0] < shown.range[1] <= parameter.maximum
                assert isinstance(parameter.default, float)
            if shown.options and parameter.choices:
                assert set(shown.options) == set(parameter.choices)


def test_a_character_with_clips_has_them_in_a_menu_and_each_joint_a_strength() -> None:
    folders = shown_parameters(load_character("humanoid"))

    clip = folders["At the next reset"][0]
    assert clip.name == "clip"
    assert {"walk", "run", "backflip"} <= set(clip.options)
    assert [each.label for each in folders["Strengths"]][:2] == ["chest", "neck"]


def test_a_character_without_clips_has_no_menu_of_them() -> None:
    names = {
        each.name for folder in shown_parameters(load_character("lift")).values() for each in folder
    }

    assert "clip" not in names
    assert "gravity" in names
