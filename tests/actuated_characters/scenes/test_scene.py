"""Scenes as their files have them, and the list of them."""

from pathlib import Path

import pytest

from actuated_characters.cli import main
from actuated_characters.scenes.scene import load_scene, scene_names
from msgs_config.errors import ConfigurationError
from sim_node.parameters import load_parameters


def test_the_list_has_a_line_for_each_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["play", "--list"]) == 0

    lines = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[0] for line in lines] == scene_names()
    assert all(line.partition(": ")[2].endswith(".") for line in lines)
    assert {"brawl", "walker"} <= set(scene_names())


@pytest.mark.parametrize("name", scene_names())
def test_both_sides_of_a_scene_agree(name: str) -> None:
    scene = load_scene(name)
    parts = load_parameters(scene.simulator).characters
    controllers = list(scene.nodes.values())[1:]

    assert len(parts) == len(controllers)
    for part, controller in zip(parts, controllers, strict=True):
        assert controller["rate"] == part.values["rate"]
        assert controller["character"] == part.values["character"]
        assert controller.get("placement", [0.0] * 4) == part.values["placement"]


def test_a_file_is_read_as_rcl_reads_it_and_settings_count_more(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(
        "# Mine.\n"
        "/**/sim_node: {ros__parameters: {characters: [a, b], rate: 240, a: {character: lift}}}\n"
        "/**/controller_node: {ros__parameters: {rate: 240, gains: {hinge: {p: 1.0}}, law: pd}}\n"
        "/a/controller_node: {ros__parameters: {rate: 480, law: pid}}\n"
    )

    scene = load_scene(str(file), {"controller_node": {"law": "zero"}})

    assert (scene.name, scene.title, scene.characters) == ("mine", "Mine.", ["a", "b"])
    assert list(scene.nodes) == ["sim_node", "a/controller_node", "b/controller_node"]
    assert scene.simulator["a.character"] == "lift"
    own = {"gains.hinge.p": 1.0, "law": "zero"}
    assert scene.nodes["a/controller_node"] == {"character": "lift", "rate": 480, **own}
    assert scene.nodes["b/controller_node"] == {"rate": 240, **own}


def test_a_file_beside_the_scene_is_found_and_what_is_no_file_stays(tmp_path: Path) -> None:
    for name in ("mine.urdf", "walk", "body.glb"):
        (tmp_path / name).touch()
    file = tmp_path / "mine.yaml"
    file.write_text(
        "/**/sim_node: {ros__parameters: {terrain: mine.urdf}}\n"
        "/**/controller_node: {ros__parameters: {clip: walk}}\n"
        "/**/viewer: {ros__parameters: {skin: body.glb, about: Mine.}}\n"
    )

    scene = load_scene(str(file))

    assert scene.simulator["terrain"] == str(tmp_path / "mine.urdf")
    assert scene.nodes["controller_node"]["clip"] == "walk"
    assert scene.viewer == {"skin": str(tmp_path / "body.glb"), "about": "Mine."}


@pytest.mark.parametrize(
    ("viewer", "reason"),
    [
        ("{hidden: [refrence]}", "unknown 'hidden' 'refrence'; did you mean 'reference'"),
        ("{controls: [controller_node.gian_scale.p]}", "unknown control"),
        ("{controls: [controller_node.gain_scale.p 0 .inf 1 kp]}", "write it as"),
        ("{curve: [height]}", "curve"),
    ],
)
def test_a_page_that_cannot_be_is_refused_before_the_last_results_go(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], viewer: str, reason: str
) -> None:
    file, before = tmp_path / "mine.yaml", tmp_path / "run"
    file.write_text(
        "/**/sim_node: {ros__parameters: {character: lift}}\n"
        f"/**/viewer: {{ros__parameters: {viewer}}}\n"
    )
    before.mkdir()
    (before / "summary.json").write_text("{}")
    arguments = ["play", "--scene", str(file), "--no-view", "--overwrite", "--output", str(before)]

    assert main(arguments) == 1

    assert reason in capsys.readouterr().err
    assert (before / "summary.json").read_text() == "{}"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("sim_node: 3", "'sim_node' must hold a mapping 'ros__parameters'"),
        ("/**/controller_node: {ros__parameters: {rate: 240}}", "no parameters of 'sim_node'"),
        ("[]", "must hold a mapping"),
    ],
)
def test_a_malformed_file_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)

    with pytest.raises(ConfigurationError, match=reason):
        load_scene(str(file))


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--scene", "bralw"], "unknown scene 'bralw'; did you mean 'brawl'?"),
        (["--scene", "nowhere.yaml"], "nowhere.yaml: No such file"),
        (["--duration", "0"], "duration is 0.0 s"),
        (["--set", "sim_node.rate:=fast"], "'rate' is fast"),
        (
            ["--scene", "brawl", "--set", "controller_node.opponent:=nobody"],
            "'opponent' of 'left/controller_node' is nobody, which is no other character",
        ),
        (["--set", "recorder.compression:=zstd"], "unknown node 'recorder'"),
    ],
)
def test_a_mistake_is_one_clear_line(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    line: str,
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main(["play", *arguments]) == 1

    (error,) = capsys.readouterr().err.splitlines()
    assert error.startswith("error: ")
    assert line in error
    assert not list(tmp_path.iterdir())
