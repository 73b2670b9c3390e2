"""The command itself: its version, its completion in a shell, and what there is to set."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from actuated_characters.cli import main
from actuated_characters.scenes.scene import scene_names
from controller_node.parameters import PARAMETERS
from msgs_config.character.file import shipped_characters

PENDULUM_GAIN = "controller_node.gains.hinge.p:="


def test_the_version_names_what_the_last_bits_depend_on(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])

    names = {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    assert not ended.value.code
    assert {"actuated_characters", "pybullet", "mujoco-core", "numpy", "libc"} <= names


def test_the_command_has_numpy_on_one_thread() -> None:
    given = {name: value for name, value in os.environ.items() if not name.endswith("_THREADS")}
    script = (
        "import os, actuated_characters.cli, numpy; one = numpy.ones((500, 500)); one @ one;"
        "print(len(os.listdir('/proc/self/task')))"
    )

    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=given, check=True
    )

    assert done.stdout.strip() == "1", done.stdout


def test_a_signal_that_comes_as_the_command_begins_ends_it_without_a_traceback() -> None:
    script = """if True:
        import signal, sys
        from actuated_characters.cli import main
        handle = signal.signal

        def handle_one_that_waits(number, handler):
            handle(number, handler)
            signal.raise_signal(number)

        signal.signal = handle_one_that_waits
        sys.exit(main(["--version"]))"""

    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)

    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_piped_parameters_have_a_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--parameters", "controller_node", "--character", "pendulum"]) == 0

    lines = capsys.readouterr().out.splitlines()
    assert {line.split(":")[0] for line in lines} >= {each.name for each in PARAMETERS}
    (line,) = [line for line in lines if line.startswith("plan.horizon: ")]
    assert line == "plan.horizon: 0.8 s  how far it looks"
    assert "gains.hinge.p: 50 N m/rad" in "\n".join(lines)


def test_the_parameters_of_a_run_are_listed_with_its_values_and_nothing_runs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    listed = ["run", "--clip", "run", "--set", "sim_node.rate:=500", "--log-time", "simulated"]

    for node in ("sim_node", "controller_node", "recorder"):
        assert main([*listed, "--parameters", node]) == 0

    lines = capsys.readouterr().out.splitlines()
    for start in (
        "rate: 500 Hz, by default 240  ",
        "reference: clip, by default hold  ",
        "clip: run, by default walk  ",
        "log_time: simulated, by default wall  ",
    ):
        assert any(line.startswith(start) for line in lines), start
    assert not list(tmp_path.iterdir())


def test_run_without_a_word_says_what_there_is_to_run_and_runs_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "300")

    assert main(["run"]) == 0

    shown = capsys.readouterr().out
    assert all(name in shown for name in shipped_characters())
    assert "spinkick" in shown
    assert "34, floating base" in shown
    assert all(f"  {name}: " in shown for name in scene_names())
    commands = [line.split()[1:] for line in shown.splitlines() if "actuated_characters " in line]
    assert ["play", "--scene", "brawl"] in commands
    for arguments in commands:  # each can be copied: its options are there
        options = {argument for argument in arguments if argument.startswith("--")} - {"--help"}
        with pytest.raises(SystemExit):
            main([arguments[0], "--help"])
        about = capsys.readouterr().out
        assert all(option in about for option in options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("stu", {"study"}),
        ("run --char", {"--character"}),
        ("run --character hum", {"humanoid"}),
        ("run --clip wal", {"walk", "walk_mine.json"}),
        ("run --behaviour r", {"ragdoll", "reactive"}),
        ("run --character pendulum --set controller_node.gains.hinge.p", {PENDULUM_GAIN}),
        ("fo", {"fork"}),
        ("play --scene br", {"brawl"}),
        ("play --set controller_node.gains.neck.p", {"controller_node.gains.neck.p:="}),
        ("fork run_mine --set controller_node.gains.neck.p", {"controller_node.gains.neck.p:="}),
        ("run --parameters rec", {"recorder"}),
        ("study li", {"lift"}),
        ("info run", {"run_mine"}),
    ],
)
def test_a_shell_completes_commands_options_names_and_files(
    tmp_path: Path, line: str, expected: set[str]
) -> None:
    for name in ("walk_mine.json", "run_mine"):
        (tmp_path / name).touch()
    line = f"actuated_characters {line}"
    asked = {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "answer"),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
    }

    command = [sys.executable, "-m", "actuated_characters.cli"]
    subprocess.run(command, cwd=tmp_path, env=os.environ | asked, check=False)

    completions = (tmp_path / "answer").read_text().split("\n")
    assert {completion.strip() for completion in completions} == expected
