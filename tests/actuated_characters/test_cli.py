"""The command itself: its version, its completion in a shell, and what there is to set."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from actuated_characters.cli import main
from controller_node.parameters import PARAMETERS

PENDULUM_GAIN = "controller_node.gains.hinge.p:="


def test_the_version_names_what_the_last_bits_depend_on(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])

    names = {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    assert not ended.value.code
    assert {"actuated_characters", "pybullet", "mujoco-core", "numpy", "libc"} <= names


def test_piped_parameters_have_a_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["parameters", "controller_node", "--character", "pendulum"]) == 0

    lines = capsys.readouterr().out.splitlines()
    assert {line.split(":")[0] for line in lines} >= {each.name for each in PARAMETERS}
    (line,) = [line for line in lines if line.startswith("plan.horizon: ")]
    assert line == "plan.horizon: 0.8 s  how far it looks"
    assert "gains.hinge.p: 50 N m/rad" in "\n".join(lines)


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
        ("fork run_mine --set controller_node.gains.neck.p", {"controller_node.gains.neck.p:="}),
        ("parameters rec", {"recorder"}),
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
