"""The command `take`: what it says of a timeline's takes, and what it refuses."""

import re
from pathlib import Path

import pytest
import yaml

from actuated_characters.cli import main

CONTENT = {
    "duration": 0.6,
    "run": {"planner": "none"},
    "clips": [{"at": 0.0, "clip": "walk"}],
}
PUSH = {"at": 0.5, "link": "chest", "force": [0, 50, 0]}


def written(directory: Path, **changes: object) -> str:
    file = directory / "moves.yaml"
    file.write_text(yaml.safe_dump({**CONTENT, **changes}), encoding="utf-8")
    return str(file)


@pytest.mark.slow
def test_takes_are_made_listed_and_go_on_from_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def said(*arguments: str) -> str:
        assert main(["take", *arguments]) == 0
        return capsys.readouterr().out

    file = written(tmp_path)
    assert "take 1: 0.6 s from the beginning" in said(file)
    assert "nothing has changed: take 1 is of this file" in said(file)
    written(tmp_path, pushes=[PUSH])
    words = said(file, "--title", "harder")
    assert (
        "take 2, of take 1: the same up to 0.500 s, simulated from the keyframe at 0.5 s on"
        in words
    )
    assert f"actuated_characters view {tmp_path / 'moves.takes' / '2'}" in words
    written(tmp_path, pushes=[{**PUSH, "link": "neck"}])
    assert "take 3, of take 1" in said(file, "--of", "1")
    assert "take 4: 0.6 s from the beginning" in said(file, "--from-start")

    takes = tmp_path / "moves.takes"
    assert main(["compare", str(takes / "2"), str(takes / "3")]) == 1  # both with their past
    assert re.search(r"first difference: tick \d+, at 0\.50\d+ s", capsys.readouterr().out)
    table = said(file, "--list").splitlines()
    rows = [[cell.strip() for cell in line.strip("│").split("│")] for line in table if "│" in line]
    assert [(row[0], row[1], row[3]) for row in rows] == [
        ("1", "-", ""),
        ("2", "0.500 s", "harder"),
        ("3", "0.500 s", ""),
        ("4", "-", ""),
    ]


@pytest.mark.slow
def test_how_far_it_is_is_said_in_lines_for_programs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["take", written(tmp_path), "--progress"]) == 0

    lines = capsys.readouterr().out.splitlines()
    said = [re.fullmatch(r"simulated (\d+\.\d+) of 0\.6 s", line) for line in lines]
    times = [float(each[1]) for each in said if each]
    assert times and times == sorted(times)
    assert times[0] >= 0.0 and times[-1] <= 0.6


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["FILE", "--of", "7"], "unknown take '7'"),
        (["missing.yaml"], "missing.yaml: No such file"),
        (["wvae"], "unknown timeline 'wvae'"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path)

    assert main(["take", *[file if each == "FILE" else each for each in arguments]]) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert sentence in line
    assert not (tmp_path / "moves.takes").exists()
