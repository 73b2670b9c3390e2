"""`motion reconstruct --view` and scenes that are a search: the same result, and all ends well."""

import os
import re
import signal
from pathlib import Path

import pytest

from actuated_characters.cli import main
from actuated_characters.reconstruction.checkpoint import checkpoint_path
from actuated_characters.viewer.web.server import open_socket
from tests.support.page_client import PageClient
from tests.support.ros import Process, Processes, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

QUICK = ("plan.samples:=8", "plan.rounds:=1", "plan.horizon:=0.2")
SEARCH = (
    *("motion", "reconstruct", "--clip=kick", "--worlds=2", "--kept=1", "--window=0.4"),
    *(f"--set=controller_node.{setting}" for setting in QUICK),
)
LONG = 240.0  # s; compiled for the first time on a slow machine
SCENE = """\
# A kick is sought.
/**/motion_reconstruct: {ros__parameters: {clip: kick, worlds: 2, kept: 1, window: 0.2}}
/**/sim_node: {ros__parameters: {character: humanoid}}
/**/controller_node: {ros__parameters: {plan.samples: 8, plan.rounds: 1, plan.horizon: 0.2}}
/**/viewer: {ros__parameters: {about: "**Sought.**"}}
"""
SHOWN = "the page shows it until Ctrl-C"


def free_port() -> int:
    with open_socket("127.0.0.1", 0) as free:
        return int(free.getsockname()[1])


def children_of(pid: int) -> list[int]:
    """The processes that a process has begun, but for Python's tracker of what they share."""
    threads = Path(f"/proc/{pid}/task").iterdir()
    text = " ".join((thread / "children").read_text() for thread in threads)
    return [
        int(child)
        for child in text.split()
        if b"resource_tracker" not in Path(f"/proc/{child}/cmdline").read_bytes()
    ]


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.nightly), 2])
def test_a_search_that_is_watched_finds_the_same_and_shows_it_until_ctrl_c(
    processes: Processes, tmp_path: Path, workers: int
) -> None:
    watched, unseen, port = tmp_path / "watched.json", tmp_path / "unseen.json", free_port()
    view = ("--view", f"--port={port}", f"--workers={workers}")
    with PageClient(port) as page:
        command = processes.command(*SEARCH, *view, f"--output={watched}")
        wait_until(lambda: SHOWN in command.stderr, "the result", LONG)
        before = page.pictures
        wait_until(lambda: page.pictures > before + 20, "pictures")
        family = children_of(command.pid)

        assert command.end(signal.SIGINT, LONG) == 0, command.stderr
    assert main([*SEARCH, "--workers=1", f"--output={unseen}"]) == 0

    assert f"watch it at http://127.0.0.1:{port}" in command.stdout
    assert "Traceback" not in command.stderr
    assert watched.read_text() == unseen.read_text()
    assert not [pid for pid in family if Path(f"/proc/{pid}").exists()]


@pytest.mark.nightly
@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_in_the_search_leaves_the_checkpoint_and_no_process(
    processes: Processes, tmp_path: Path, workers: int
) -> None:
    output = tmp_path / "kick.json"
    view = ("--view", f"--port={free_port()}", f"--workers={workers}", "--window=0.05")
    command = processes.command(*SEARCH, *view, f"--output={output}")
    wait_until(lambda: checkpoint_path(output).exists(), "a checkpoint", LONG)
    family = children_of(command.pid)

    assert command.end(signal.SIGINT, LONG) == 130

    assert command.stderr.strip().splitlines()[-1] == "interrupted"
    assert "Traceback" not in command.stderr
    assert checkpoint_path(output).exists() and not output.exists()
    assert len(family) == (1 if workers == 1 else 1 + workers)
    assert not [pid for pid in family if Path(f"/proc/{pid}").exists()]


@pytest.mark.nightly
def test_the_search_goes_on_where_its_page_is_killed(processes: Processes, tmp_path: Path) -> None:
    output = tmp_path / "kick.json"
    view = ("--view", f"--port={free_port()}", "--workers=1")
    command = processes.command(*SEARCH, *view, f"--output={output}")
    wait_until(lambda: checkpoint_path(output).exists(), "a checkpoint", LONG)
    (page,) = children_of(command.pid)

    os.kill(page, signal.SIGKILL)

    assert command.wait(LONG) == 0, command.stderr
    assert "the search goes on unseen; the viewer has ended" in command.stdout
    assert output.exists() and not checkpoint_path(output).exists()


def test_a_port_in_use_is_one_line_before_anything_begins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_socket("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        output = tmp_path / "kick.json"
        code = main([*SEARCH, "--view", f"--port={port}", f"--output={output}"])

    (error,) = capsys.readouterr().err.splitlines()
    assert code == 1
    assert error.startswith(f"error: cannot listen on 127.0.0.1, port {port}: ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--skin", "body.glb"), "--skin and --skin-map are of --view"),
        (("--view", "--skin", "body.glb"), "body.glb"),
        (("--view", "--fps", "0"), "fps"),
    ],
)
def test_a_wrong_option_of_the_page_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    reason: str,
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main([*SEARCH, *options, "--output=kick.json"]) == 1

    (error,) = capsys.readouterr().err.splitlines()
    assert error.startswith("error: ") and reason in error
    assert not list(tmp_path.iterdir())


# Scenes


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "sought.yaml"
    file.write_text(SCENE)
    return file


def play(processes: Processes, scene: Path, *options: str) -> Process:
    return processes.command("play", "--scene", str(scene), "--duration", "0.4", *options)


@pytest.mark.nightly
def test_a_scene_is_sought_shown_and_ended_by_ctrl_c(
    processes: Processes, tmp_path: Path, scene: Path
) -> None:
    port = free_port()
    with PageClient(port) as page:
        command = play(processes, scene, "--port", str(port))
        wait_until(lambda: SHOWN in command.stderr, "the result", LONG)
        wait_until(lambda: page.pictures > 20, "pictures")

        assert command.end(signal.SIGINT, LONG) == 0, command.stderr
    assert command.stdout.startswith("A kick is sought.\nwatch it at http")
    assert (tmp_path / "runs" / "play-sought" / "sought.json").exists()
    assert re.search(r"0\.4 s, 96 ticks, 2 windows", command.stdout)


@pytest.mark.nightly
def test_without_a_page_a_scene_ends_when_it_is_found_and_is_not_overwritten(
    processes: Processes, tmp_path: Path, scene: Path
) -> None:
    given = ("--no-view", "--output", str(tmp_path / "out"))
    command = play(processes, scene, *given)
    assert command.wait(LONG) == 0, command.stderr

    again = play(processes, scene, *given)

    assert again.wait(LONG) == 1
    assert "sought.json exists; --overwrite replaces it" in again.stderr
    assert play(processes, scene, *given, "--overwrite").wait(LONG) == 0


@pytest.mark.nightly
def test_ctrl_c_while_a_scene_is_sought_ends_it_in_good_order(
    processes: Processes, tmp_path: Path, scene: Path
) -> None:
    command = processes.command("play", "--scene", str(scene), "--no-view")
    checkpoint = tmp_path / "runs" / "play-sought" / "sought.json.checkpoint"
    wait_until(checkpoint.exists, "a checkpoint", LONG)

    assert command.end(signal.SIGINT, LONG) == 0, command.stderr
    assert command.stdout.splitlines()[-1].endswith("sought.json.checkpoint has the search so far")


@pytest.mark.parametrize(
    ("text", "changed", "reason"),
    [
        ("worlds: 2", "wolrds: 2", "wolrds"),
        ("kept: 1", "kept: 3", "--kept is 3; it must be 1 to 2"),
        ("clip: kick", "clip: kcik", "did you mean 'kick'"),
        ("character: humanoid", "character: humanoid, mode: realtime", "neither 'mode' realtime"),
        ("character: humanoid", "characters: [a, b]", "a search is for one character's motion"),
    ],
)
def test_a_mistake_in_a_scene_is_one_line(
    scene: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    text: str,
    changed: str,
    reason: str,
) -> None:
    monkeypatch.chdir(scene.parent)
    scene.write_text(SCENE.replace(text, changed))

    assert main(["play", "--scene", str(scene), "--no-view"]) == 1

    (error,) = capsys.readouterr().err.splitlines()
    assert error.startswith("error: ") and reason in error
    assert [each.name for each in scene.parent.iterdir()] == [scene.name]
