"""A bag names what its controller has read; what is another file by now is said."""

from dataclasses import replace
from pathlib import Path

import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.replay.players.controller_parameters import changed_files
from controller_node import parameters
from controller_node.controller_setups import make_setup
from controller_node.files_read import files_read
from msgs_config.digests import sha256_of
from msgs_config.errors import ActuatedCharactersError
from tests.support.physics import character

KEYS = "keyframes:\n- {time: 0.0, pose: {hinge: 0.0}}\n- {time: 0.5, pose: {hinge: %s}}\n"
GAIT = {"clip walk": "humanoid3d_walk.txt", "clip run": "humanoid3d_run.txt"}
WALK_BY_POLICY = {"reference": "clip", "clip": "walk", "planner": "policy"}
GET_UPS = {
    "clip getup_faceup": "humanoid3d_getup_faceup.txt",
    "clip getup_facedown": "humanoid3d_getup_facedown.txt",
}


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    path = tmp_path / "keys.yaml"
    path.write_text(KEYS % 0.5, encoding="utf-8")
    return path


@pytest.fixture
def run(tmp_path: Path, keys: Path) -> Path:
    options = ["--in-process", "--character", "pendulum", "--duration", "0.4"]
    options += ["--set", "controller_node.reference:=keyframes"]
    options += ["--set", f"controller_node.keyframes:={keys}"]
    assert main(["run", *options, "--output", str(tmp_path / "run")]) == 0
    return tmp_path / "run"


@pytest.mark.slow
def test_a_fork_and_a_replay_say_that_keyframes_are_others(
    run: Path, keys: Path, domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    del domain  # the nodes inherit it
    said = f"{keys} is not the file that it was: its content differs"
    assert changed_files(read_recording(run)) == []
    assert main(["fork", str(run), "--at", "0.1"]) == 0
    assert "is not the file" not in capsys.readouterr().out

    keys.write_text(KEYS % 0.9, encoding="utf-8")

    # The past, which a fork without a keyframe simulates again, is not what it was, either.
    assert main(["fork", str(run), "--at", "0.1", "--overwrite"]) == 1
    printed = capsys.readouterr()
    assert printed.out == f"warning: {said}\n"
    assert "effort of 'hinge' was" in printed.err
    assert main(["replay", str(run)]) == 0  # of efforts, for which no file counts
    assert main(["replay", str(run), "--through-topics", "simulator"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "command of 'hinge' is" in line and said in line


def test_a_bag_that_names_no_files_says_nothing(run: Path, keys: Path) -> None:
    keys.write_text(KEYS % 0.9, encoding="utf-8")
    recording = read_recording(run)
    settings = [replace(each, files={}) for each in recording.controller]

    assert changed_files(replace(recording, controller=tuple(settings))) == []


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ({"reference": "hold", "planner": "none"}, {}),
        ({"reference": "clip", "clip": "kick"}, {"clip kick": "humanoid3d_kick.txt"}),
        ({"law": "feedforward", "feedforward": "{efforts}"}, {"feedforward": "efforts.csv"}),
        (
            {"reference": "keyframes", "keyframes": "humanoid_stand"},
            {"keyframes": "humanoid_stand.yaml"},
        ),
        (
            {"reference": "steered", "behaviour": "state_machine", "machine": "run"},
            {**GAIT, "machine": "run.yaml"},
        ),
        (
            {"reference": "clip", "clip": "walk", "planner": "hybrid"},
            {"clip walk": "humanoid3d_walk.txt", "policy": "walk.npz"},
        ),
        (
            {**WALK_BY_POLICY, "policy": "walk"},
            {"clip walk": "humanoid3d_walk.txt", "policy": "walk.npz"},
        ),
        (
            {**WALK_BY_POLICY, "behaviour": "active_ragdoll"},
            {
                "clip walk": "humanoid3d_walk.txt",
                **GET_UPS,
                "policy": "walk.npz",
                "policy getup_faceup": "getup_faceup.npz",
                "policy getup_facedown": "getup_facedown.npz",
            },
        ),
        ({"reference": "steered", "steering.clips": ["run"]}, {"clip run": "humanoid3d_run.txt"}),
        ({"behaviour": "active_ragdoll"}, GET_UPS),
        ({"behaviour": "active_ragdoll", "recovery": "ramp", "library": ["kick"]}, {}),
        (
            {"behaviour": "reactive", "library": ["kick"]},
            {"clip kick": "humanoid3d_kick.txt", **GET_UPS},
        ),
        (
            {"behaviour": "pursuit", "opponent": "other", "strike.clips": ["punch"]},
            {**GET_UPS, "clip punch": "humanoid3d_punch.txt"},
        ),
    ],
)
def test_a_controller_reads_what_is_in_use(
    given: dict[str, object], names: dict[str, str], tmp_path: Path
) -> None:
    humanoid, efforts = character("humanoid"), tmp_path / "efforts.csv"
    efforts.write_text("time_s\n0\n", encoding="utf-8")
    if "feedforward" in given:
        given = {**given, "feedforward": str(efforts)}

    setup = make_setup(humanoid, parameters.resolve_for(humanoid, given))

    files = files_read(humanoid, setup.values)
    assert {name: path.name for name, path in files.items()} == names
    assert setup.files == {name: sha256_of(path) for name, path in files.items()}


def test_a_policy_that_is_not_there_is_an_error() -> None:
    humanoid = character("humanoid")
    values = parameters.resolve_for(
        humanoid,
        {"reference": "clip", "clip": "kick", "planner": "policy", "policy": "nobody.npz"},
    )
    with pytest.raises(ActuatedCharactersError, match=r"parameter 'policy' is 'nobody\.npz'"):
        files_read(humanoid, values)


def test_a_file_that_was_written_again_has_another_digest(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"")
    # The well-known digest of nothing, FIPS 180-4.
    assert sha256_of(path) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    path.write_bytes(b"abc")
    assert sha256_of(path) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
