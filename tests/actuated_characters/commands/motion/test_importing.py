"""`motion import` and `motion info`: files, folders, and what is refused in one line."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from actuated_characters.cli import main
from character_motion.bvh.kinematics import forward_kinematics
from character_motion.bvh.reading import read_bvh
from character_motion.clips.motion_clip import read_motion_clip
from tests.support.capture_makers import MAKERS
from tests.support.captures import capture
from tests.support.physics import character

WALK = MAKERS["lafan"]  # 38 frames


@pytest.fixture(scope="module")
def bvh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return capture(tmp_path_factory.mktemp("bvh") / "walk.bvh", WALK)


@pytest.fixture(scope="module")
def clip(bvh: Path) -> Path:
    assert main(["motion", "import", str(bvh), "--output", str(bvh.with_suffix(".json"))]) == 0
    return bvh.with_suffix(".json")


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    capsys.readouterr()
    assert main(["motion", *map(str, arguments)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and error.count("\n") == 1
    return error


def test_a_file_becomes_a_clip_with_a_report_and_a_picture(
    bvh: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "a.json"

    assert main(["motion", "import", str(bvh), "--output", str(output), "--licence", "CC0"]) == 0

    printed = " ".join(capsys.readouterr().out.split())
    for text in (
        "up is y",
        "(cm)",
        "feet in the ground",
        "skating",
        "limits touched",
        "worst joint",
    ):
        assert text in printed
    assert f"run --clip {output} --duration 1.2" in printed
    made = read_motion_clip(character("humanoid"), str(output))
    assert made.source["file"] == "walk.bvh" and made.source["licence"] == "CC0"
    assert made.contacts["left_heel"] and made.quality["feet_in_ground_m"] < 0.01
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_info_says_what_is_in_a_file_and_in_a_clip(
    bvh: Path, clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["motion", "info", str(bvh), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["left_knee"] == "LeftLeg" and "up is y" in facts["conventions"]
    assert main(["motion", "info", str(clip), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["from"] == "walk.bvh" and facts["licence"] == "unknown" and facts["frames"] == 38
    assert main(["motion", "info", "walk"]) == 0
    assert "limits touched" in capsys.readouterr().out
    assert main(["motion", "info", str(clip.parent)]) == 0
    assert "walk.bvh" in capsys.readouterr().out


def test_a_folder_becomes_a_folder_and_a_broken_file_stops_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    captures = tmp_path / "captures"
    (captures / "inside").mkdir(parents=True)
    capture(captures / "a.bvh", WALK, change=lambda values: values[:6])
    capture(captures / "inside" / "b.BVH", WALK, change=lambda values: values[:6])
    (captures / "c.bvh").write_text("no motion\n")
    output = tmp_path / "clips"

    code = main(["motion", "import", str(captures), "--output", str(output), "--no-picture"])

    printed = capsys.readouterr()
    assert code == 1 and "c.bvh, line 1: 'no motion'" in printed.err
    assert "1 of 3 files were not imported" in printed.err
    made = sorted(str(path.relative_to(output)) for path in output.rglob("*"))
    assert made == ["a.json", "inside", "inside/b.json"]


def test_a_part_of_a_file_is_made(bvh: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.json"
    arguments = f"motion import {bvh} --output {output} --from 0.2 --to 0.7 --no-picture"

    assert main(arguments.split()) == 0

    assert read_motion_clip(character("humanoid"), str(output)).duration == pytest.approx(0.5)


def test_axes_and_units_can_be_told(bvh: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.json"
    arguments = f"motion import {bvh} --output {output} --up y --units cm --no-picture"

    assert main(arguments.split()) == 0


def test_what_cannot_be_imported_is_one_clear_line(
    bvh: Path, clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty, other = tmp_path / "empty.bvh", tmp_path / "other"
    empty.write_text("")
    other.mkdir()
    nowhere = tmp_path / "a.json"
    odd = tmp_path / "odd.bvh"
    odd.write_text(bvh.read_text().replace("LeftLeg", "Pillar"))

    def imported(*arguments: object) -> str:
        return refused(capsys, "import", *arguments)

    assert "the end of the file" in imported(empty, "--output", nowhere)
    assert "No such file" in imported(tmp_path / "none.bvh", "--output", nowhere)
    assert "exists already; --overwrite" in imported(bvh, "--output", clip)
    assert "it must end in .json" in imported(bvh, "--output", tmp_path / "a.bvh")
    assert "there is no .bvh file of motion in it" in imported(other)
    assert "no part of two frames" in imported(bvh, "--output", nowhere, "--from", 9)
    assert "no joint found for left_knee" in imported(odd, "--output", nowhere)
    assert "character 'laikago'" in imported(bvh, "--output", nowhere, "--character", "laikago")
    assert not nowhere.exists()


def test_a_joint_of_an_odd_name_is_told_by_a_file(bvh: Path, tmp_path: Path) -> None:
    odd, names, output = tmp_path / "odd.bvh", tmp_path / "map.yaml", tmp_path / "a.json"
    odd.write_text(bvh.read_text().replace("LeftLeg", "Pillar"))
    names.write_text("left_knee: Pillar\n")
    arguments = f"motion import {odd} --map {names} --output {output} --no-picture"

    assert main(arguments.split()) == 0

    source = read_motion_clip(character("humanoid"), str(output)).source
    assert source["joints"]["left_knee"] == "Pillar"


def test_a_hundred_megabytes_end_soon(
    bvh: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    large = tmp_path / "large.bvh"
    head, row = bvh.read_bytes(), bvh.read_bytes().splitlines()[-1] + b"\n"
    with large.open("wb") as file:
        file.write(head)
        file.write(row * (100_000_000 // len(row)))
    start = time.monotonic()

    assert "larger than 64 MiB" in refused(capsys, "import", large)

    assert time.monotonic() - start < 10.0


BROKEN = st.sampled_from(["nan", "1e999", "", "x", "{", "}", "1 2 3", "CHANNELS 3", "\t", "-"])


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(line=st.integers(0, 200), word=st.integers(0, 80), what=BROKEN)
def test_a_word_that_is_wrong_ends_in_a_clip_or_in_one_line(
    bvh: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], line: int, word: int, what: str
) -> None:
    lines = bvh.read_text().splitlines()
    words = lines[line % len(lines)].split(" ")
    words[word % len(words)] = what
    lines[line % len(lines)] = " ".join(words)
    file, output = tmp_path / "broken.bvh", tmp_path / "broken.json"
    file.write_text("\n".join(lines))
    capsys.readouterr()

    code = main(["motion", "info", str(file)])

    error = capsys.readouterr().err
    assert code in (0, 1) and error.count("\n") == code
    assert not output.exists()


@pytest.mark.slow
def test_a_run_tracks_an_imported_clip_and_is_replayed_without_it(
    clip: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "own.json"
    own.write_bytes(clip.read_bytes())
    run = tmp_path / "run"
    arguments = ["run", "--clip", str(own), "--duration", "1.2", "--composed", "--output", str(run)]

    assert main(arguments) == 0
    own.unlink()
    assert main(["replay", str(run)]) == 0

    summary = json.loads((run / "summary.json").read_text())
    assert not summary["fell"] and summary["joint_error_mean_rad"] < 0.10
    assert summary["ticks"] == 288


@pytest.mark.parametrize(("unit", "order"), [("m", "ZXY"), ("cm", "ZYX")])
def test_from_bvh_to_clip_to_bvh_joints_stay_where_they_are(
    tmp_path: Path, unit: str, order: str
) -> None:
    first, clip, second = (tmp_path / name for name in ("a.bvh", "a.json", "b.bvh"))
    options = f"--units {unit} --order {order}"
    assert main(f"export spinkick --output {first} {options}".split()) == 0

    assert main(f"motion import {first} --output {clip} --no-picture".split()) == 0
    assert main(f"export {clip} --output {second} {options}".split()) == 0

    places = [forward_kinematics(read_bvh(file)).positions for file in (first, second)]
    metres = 0.01 if unit == "cm" else 1.0
    assert np.abs(places[1] - places[0]).max() * metres < 1e-3
