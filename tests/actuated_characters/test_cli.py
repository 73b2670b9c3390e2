"""The command itself: its version, its completion in a shell, and what there is to set."""

import subprocess
import sys

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


@pytest.fixture
def script(capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest) -> str:
    """What `--print-completion` prints."""
    with pytest.raises(SystemExit) as ended:
        main(["--print-completion", request.param])
    assert not ended.value.code
    return capsys.readouterr().out


@pytest.mark.parametrize("script", ["bash"], indirect=True)
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["stu"], {"study"}),
        (["run", "--char"], {"--character"}),
        (["run", "--character", "hum"], {"humanoid"}),
        (["run", "--clip", "wal"], {"walk", "walk_mine.json"}),
        (["run", "--behaviour", "r"], {"ragdoll", "reactive"}),
        (["study", "li"], {"lift"}),
        (["info", "run"], {"run_mine"}),
    ],
)
def test_bash_completes_commands_options_names_and_files(
    tmp_path, script: str, words: list[str], expected: set[str]
) -> None:
    for name in ("walk_mine.json", "run_mine"):
        (tmp_path / name).touch()
    line = " ".join(["actuated_characters", *words])
    program = (
        f"{script}\nCOMP_WORDS=({line}); COMP_CWORD={len(words)}\n"
        "$(complete -p actuated_characters | grep -o '_shtab_[a-z_]*')\n"
        "printf '%s\\n' \"${COMPREPLY[@]}\""
    )

    done = subprocess.run(
        ["bash", "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False
    )

    assert set(done.stdout.split()) == expected, done.stderr


@pytest.mark.parametrize("script", ["zsh"], indirect=True)
def test_zsh_is_told_of_every_command_in_a_line(script: str) -> None:
    assert script.startswith("#compdef actuated_characters")
    lines = [line for line in script.splitlines() if line.startswith("    ")]
    for command in ("run", "reconstruct", "render", "replay", "study", "list", "parameters"):
        (line,) = [line for line in lines if line.strip().startswith(f"{command}:'")]
        assert len(line) < 200


def test_without_shtab_it_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "shtab", None)

    assert main(["--print-completion", "bash"]) == 1

    assert "pip install 'actuated_characters[completion]'" in capsys.readouterr().err
