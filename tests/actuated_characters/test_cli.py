"""The command itself: its version, and what there is to set."""

import pytest

from actuated_characters.cli import main
from controller_node.parameters import PARAMETERS


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
