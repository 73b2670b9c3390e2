"""What a fork refuses, in one line, before anything starts."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from actuated_characters.bags.recording import Recording, read_recording, read_recordings
from actuated_characters.cli import main
from actuated_characters.fork import plan as module
from tests.support.eventful import Eventful, eventful_run, write_timed

TICKS = 48
END = "0.2"  # s


@pytest.fixture(scope="module")
def made() -> Eventful:
    return eventful_run("pendulum", TICKS)


@pytest.fixture
def run(made: Eventful, tmp_path: Path) -> Path:
    write_timed(tmp_path / "run" / "bag", made.messages())
    return tmp_path / "run"


def refusal(capsys: pytest.CaptureFixture[str], run: Path, *options: str) -> str:
    """The one line of a fork that is refused."""
    assert main(["fork", str(run), *options]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert not (run.parent / f"{run.name}-fork").exists()
    return line


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--at", "0.3"], "--at is 0.3 s; it must be 0 s to 0.2 s"),
        (["--at", "nan"], "--at is nan s; it must be 0 s to 0.2 s"),
        (["--at", "-1"], "--at is -1 s; it must be 0 s to 0.2 s"),
        (["--at", END], "the fork lasts 0.2 s, so that nothing comes after 0.2 s; set --duration"),
        (["--at", "0.1", "--duration", "0.1"], "nothing comes after 0.1 s; let it be longer"),
        (["--at", "0.1", "--duration", "inf"], "duration is inf s; it must be"),
        (["--at", "0.1", "--push", "rod:1,0,0"], "write it as LINK:FX,FY,FZ@S"),
        (["--at", "0.1", "--push", "rod:1,0,0@0.05"], "begins at 0.05 s, before the fork at 0.1 s"),
        (["--at", "0.1", "--push", "nose:1,0,0@0.15"], "push: unknown link 'nose'"),
        (["--at", "0.1", "--throw", "mass=1"], "throw 'mass=1': 'speed' is missing"),
        (["--at", "0.1", "--set", "sim_node.rate:=3"], "'rate' of sim_node cannot change"),
        (
            ["--at", "0.1", "--set", "sim_node.gravity:=3"],
            "'gravity' of sim_node changes at a reset",
        ),
        (["--at", "0.1", "--set", "sim_node.gravty:=3"], "parameter of sim_node 'gravty'"),
        (["--at", "0.1", "--set", "controller_node.law:=lqr"], "'law': 'lqr'"),
        (["--at", "0.1", "--set", "recorder.compression:=zstd"], "node 'recorder'"),
        (["--at", "0.1", "--output", "{run}"], "is the run that is forked"),
    ],
)
def test_a_wrong_option_is_one_line(
    run: Path, capsys: pytest.CaptureFixture[str], options: list[str], expected: str
) -> None:
    given = [option.format(run=run) for option in options]

    assert expected in refusal(capsys, run, *given)


def test_without_a_bag_nothing_can_be_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", "--in-process", "--character", "pendulum", "--duration", "0.1"]
    assert main([*arguments, "--no-record", "--output", str(tmp_path / "run")]) == 0
    capsys.readouterr()

    line = refusal(capsys, tmp_path / "run", "--at", "0.05")

    assert "no recording in" in line and "the run there left none" in line


def test_what_is_no_bag_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no run or recording at" in refusal(capsys, tmp_path / "nothing", "--at", "1")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"controller": ()}, "its controller cannot be started"),
        ({"skipped_states": 3}, "what the controller did before is not in it"),
        ({"parameters": {"mode": "realtime"}}, "it ran in real time"),
        ({"pushes_sent": 1, "applied_wrench": ()}, "but not which of them acted"),
    ],
)
def test_a_recording_that_does_not_say_all_is_refused(
    run: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    change: dict[str, Any],
    expected: str,
) -> None:
    recording = read_recording(run)
    parameters = {**recording.parameters, **change.pop("parameters", {})}
    changed = replace(recording, parameters=parameters, **change)
    monkeypatch.setattr(module, "read_recordings", lambda path, begin=None: (changed,))

    assert expected in refusal(capsys, run, "--at", "0.1")


def test_several_characters_are_refused(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def twice(path: Path, begin: object = None) -> tuple[Recording, ...]:
        return (*read_recordings(path), *read_recordings(path))

    monkeypatch.setattr(module, "read_recordings", twice)

    assert "it has 2 characters, and a fork repeats a run of one" in refusal(
        capsys, run, "--at", "0.1"
    )
