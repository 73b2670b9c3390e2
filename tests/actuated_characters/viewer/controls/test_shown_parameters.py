"""The panel's parameters are ones that the nodes have, within their bounds."""

import pytest

from actuated_characters.scenes.scene import load_scene, scene_names
from actuated_characters.viewer.controls.shown_parameters import (
    CONTROLLER,
    SIMULATOR,
    TO_TRY,
    ShownParameter,
    check_controls,
    parse_slider,
    shown_parameters,
)
from controller_node.parameters import PARAMETERS as CONTROLLERS
from controller_node.parameters import character_parameters
from msgs_config.character.loading import load_character
from msgs_config.errors import ConfigurationError
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


def test_a_control_that_no_page_has_is_told_with_what_is_like_it() -> None:
    with pytest.raises(ConfigurationError, match=r"did you mean 'controller_node\.gain_scale\.p'"):
        check_controls(["controller_node.gian_scale.p"])


def test_a_scene_has_its_own_controls_first_and_none_twice() -> None:
    texts = ("controller_node.gain_scale.p 0 9 0.5 kp", "controller_node.law", "sim_node.gravity")
    folders = shown_parameters(load_character("lift"), texts)

    assert next(iter(folders)) == TO_TRY
    assert [each.name for each in folders[TO_TRY]] == ["gain_scale.p", "law", "gravity"]
    keys = [each.key for folder in folders.values() for each in folder]
    assert len(keys) == len(set(keys))


def test_a_slider_is_read_from_its_text() -> None:
    slider = parse_slider("sim_node.wrench_duration 0.1 2 0.1 Pushes (s)")

    expected = ShownParameter(
        "wrench_duration", "Pushes (s)", range=(0.1, 2.0, 0.1), nodes=(SIMULATOR,)
    )
    assert slider == expected


@pytest.mark.parametrize(
    "text",
    [
        "controller_node.law 0 1",
        "viewer.fps 0 9 1 fps",
        "controller_node.gain_scale.p 3 1 0.1 kp",
        "controller_node.gain_scale.p 0 1 nan kp",
        "controller_node.gain_scale.p 0 inf 1 kp",
        "",
    ],
)
def test_a_control_that_is_none_is_refused_in_a_line(text: str) -> None:
    with pytest.raises(ConfigurationError, match="write it as"):
        check_controls([text])


@pytest.mark.parametrize("name", scene_names())
def test_the_controls_and_curves_of_a_scene_are_ones_of_its_nodes(name: str) -> None:
    scene = load_scene(name)
    of_characters = {str(each["character"]) for each in list(scene.nodes.values())[1:]}
    for character in map(load_character, of_characters):
        known = {
            CONTROLLER: {each.name for each in [*CONTROLLERS, *character_parameters(character)]},
            SIMULATOR: {each.name for each in SIMULATORS},
        }
        texts = scene.viewer.get("controls", [])
        assert isinstance(texts, list)
        own = shown_parameters(character, texts).get(TO_TRY, ())
        assert len(own) == len(texts)
        assert all(each.name in known[node] for each in own for node in each.nodes)
    curves = scene.viewer.get("curves", [])
    assert isinstance(curves, list)
    names = {dof for each in of_characters for dof in load_character(each).layout.dof_names}
    assert set(curves) <= names
