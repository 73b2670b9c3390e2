"""Commands about window feedback: mistakes, and what is resumed."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiment.cli import main
from experiment.samcon import reconstruction
from experiment.samcon.gains_file import read_gains, write_gains
from experiment.samcon.search import Progress
from msgs_config.errors import ConfigurationError, RunError

PROJECT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--output", "walk.txt"], "it must end in .json"),
        (["--output", "nowhere/walk.json"], "there is no directory nowhere"),
        (["--output", "walk.json", "--cycles", "1"], "--cycles is 1; it must be 2 to 1000"),
        (["--output", "walk.json", "--rate", "0"], "rate"),
        (["--output", "walk.json", "--delay-ticks", "-1"], "command_delay_ticks"),
        (["--output", "walk.json", "--rounds", "0"], "--rounds is 0; it must be 1 to 1000"),
        (["--output", "walk.json", "--headings", "9"], "--headings is 9; it must be 1 to 8"),
        (["--output", "walk.json", "--push", "nan"], "--push is nan; it must be 0 to 1000"),
        (["--output", "walk.json", "--workers", "0"], "--workers is 0"),
        (["--output", "walk.json", "--clip", "getup_faceup", "--cycles", "2"], "--cycles is 2"),
        (["--output", "walk.json", "--first", "none.json"], "none.json: no such file"),
        (["--output", "walk.json", "--clip", "stroll"], "stroll"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: list[str],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main(["fit-feedback", *arguments]) == 1

    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert reason in told[0]
    assert not list(tmp_path.iterdir())


def test_a_window_feedback_of_another_cycle_is_refused_before_anything_begins(
    tmp_path: Path,
) -> None:
    output = tmp_path / "walk.json"
    command = [sys.executable, "-m", "experiment.cli", "reconstruct", "--output", str(output)]
    command += ["--rate", "480", "--window", "0.2", "--window-feedback", "walk@480"]

    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, timeout=60)

    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "has 12 windows a cycle; here a cycle has 6" in done.stderr
    assert not output.exists()


@pytest.mark.parametrize("option", [["--fit", "16"], ["--open-loop"]])
def test_a_window_feedback_where_it_cannot_act_is_refused(
    option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["reconstruct", *option, "--window-feedback", "walk@480"]

    assert main([*given, "--output", str(tmp_path / "walk.json")]) == 1

    assert "--fit and --open-loop do without" in capsys.readouterr().err


# What is resumed

QUICK = ["--samples", "1", "--kept", "1", "--workers", "1", "--rate", "480", "--delay-ticks", "1"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "then"),
    [
        ([], []),
        (["--window-feedback", "none"], []),
        (["--open-loop"], ["--open-loop"]),
        (["--window-feedback", "walk@480"], ["--window-feedback", "walk@480"]),
    ],
)
def test_a_search_resumes_with_the_feedbacks_that_it_had(
    first: list[str], then: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, stopped = tmp_path / "whole.json", tmp_path / "stopped.json"
    codes = [main(["reconstruct", *QUICK, *first, "--output", str(whole)])]
    write = reconstruction.write_checkpoint

    def stop(path: Path, key: dict[str, Any], progress: Progress) -> None:
        write(path, key, progress)
        if progress.window == 1:
            raise RunError("stopped")

    with monkeypatch.context() as patch:
        patch.setattr(reconstruction, "write_checkpoint", stop)
        assert main(["reconstruct", *QUICK, *first, "--output", str(stopped)]) == 1
    codes.append(main(["reconstruct", *QUICK, *then, "--resume", "--output", str(stopped)]))

    assert codes[0] == codes[1]
    assert stopped.read_bytes() == whole.read_bytes()


def test_another_window_feedback_is_another_search(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    output, gains = tmp_path / "walk.json", tmp_path / "walk.gains.json"
    shipped = read_gains("walk@480")
    write_gains(gains, shipped)
    write = reconstruction.write_checkpoint

    def stop(path: Path, key: dict[str, Any], progress: Progress) -> None:
        write(path, key, progress)
        raise RunError("stopped")

    named = ["--window-feedback", str(gains), "--output", str(output)]
    with monkeypatch.context() as patch:
        patch.setattr(reconstruction, "write_checkpoint", stop)
        assert main(["reconstruct", *QUICK, *named]) == 1
    write_gains(gains, replace(shipped, constants=2.0 * shipped.constants))
    capsys.readouterr()

    assert main(["reconstruct", *QUICK, *named, "--resume"]) == 1

    assert "is of a search whose window_digest is" in capsys.readouterr().err


def test_a_feedback_of_joints_that_do_not_exist_is_refused_with_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gains, output = tmp_path / "other.json", tmp_path / "walk.json"
    shipped = read_gains("walk@480")
    for dofs, reason in (
        (("tail", *shipped.dofs[1:]), "unknown degree of freedom 'tail'"),
        (("root_x", *shipped.dofs[1:]), "comes in parts"),
    ):
        write_gains(gains, replace(shipped, dofs=dofs))
        for command in (
            ["reconstruct", *QUICK, "--window-feedback", str(gains)],
            ["fit-feedback", "--rate", "480", "--first", str(gains)],
        ):
            assert main([*command, "--output", str(output)]) == 1
            (told,) = capsys.readouterr().err.splitlines()
            assert f"window feedback {gains}: " in told
            assert reason in told


def test_gains_that_are_no_numbers_are_not_written(tmp_path: Path) -> None:
    shipped = read_gains("walk@480")
    with pytest.raises(ConfigurationError, match="not finite"):
        write_gains(tmp_path / "g.json", replace(shipped, constants=shipped.constants * np.nan))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "content",
    [
        '{"key": {"feedback": [], "window_feedback": ""}}',
        '{"key": {"feedback": {}, "window_feedback": ["x"]}}',
        '{"key": []}',
        "[" * 100_000,
    ],
)
@pytest.mark.parametrize("option", [[], ["--open-loop"]])
def test_a_malformed_checkpoint_is_refused_in_a_line(
    content: str, option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "walk.json"
    output.with_name("walk.json.checkpoint").write_text(content, encoding="utf-8")

    assert main(["reconstruct", *QUICK, *option, "--resume", "--output", str(output)]) == 1

    lines = capsys.readouterr().err.splitlines()
    assert "error:" in lines[-1]
    assert not any("Traceback" in line for line in lines)


def test_a_window_without_a_tick_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["reconstruct", "--window", "0.001", "--output", str(tmp_path / "walk.json")]

    assert main(given) == 1

    assert "window is 0.001 s; it must be a tick or more, 0.00417 s" in capsys.readouterr().err
