"""`motion trim`, `loop`, `mirror`, `blend` and `speed`: files, folders, and what is refused."""

import json
from pathlib import Path

import pytest

from actuated_characters.cli import main
from msgs_config.clips.reading import read_clip
from tests.support.physics import character


@pytest.mark.parametrize(
    ("words", "duration", "wraps"),
    [
        ("trim walk --from 0.2 --to 0.9", 0.667, False),
        ("mirror kick", 1.533, False),
        ("blend walk run --over 0.3", 1.767, False),
        ("speed run --factor 2", 0.4, True),
        ("loop dance_a --from 0.4 --to 1.2", 0.8, True),
    ],
)
def test_a_clip_is_made(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: str,
    duration: float,
    wraps: bool,
) -> None:
    output = tmp_path / "a.json"

    assert main(["motion", *words.split(), "--output", str(output)]) == 0

    assert "feet in the ground" in capsys.readouterr().out
    frames = read_clip(character("humanoid"), str(output))
    assert frames.times[-1] == pytest.approx(duration, abs=0.05) and frames.wraps == wraps
    assert json.loads(output.read_text())["Source"]["edits"]


def test_a_folder_of_clips_becomes_another_one(tmp_path: Path) -> None:
    clips, images = tmp_path / "clips", tmp_path / "images"
    for name in ("walk", "run"):
        output = clips / f"{name}.json"
        assert main(["motion", "speed", name, "--factor", "1.5", "--output", str(output)]) == 0
    (clips / "LICENCE.txt").write_text("Everybody may use these clips.\n")

    assert main(["motion", "mirror", str(clips), "--output", str(images)]) == 0

    assert sorted(path.name for path in images.iterdir()) == ["run.json", "walk.json"]


def test_a_folder_of_notes_alone_has_no_clips(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "LICENCE.txt").write_text("Everybody may use these clips.\n")

    assert main(["motion", "mirror", str(tmp_path)]) == 1

    error = capsys.readouterr().err
    assert "there is no .json or .txt file of motion in it" in error and error.count("\n") == 1


def test_what_cannot_be_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "a.json"
    output.write_text("")
    for words, message in (
        (f"trim walk --output {output}", "exists already; --overwrite replaces it"),
        (f"trim walk --from 5 --overwrite --output {output}", "there are 0 frames"),
        (f"trim walk --from 1 --to 4 --overwrite --output {output}", "4 s is not within the clip"),
        ("speed wlk --factor 2", "unknown clip 'wlk'; did you mean 'walk'"),
        ("mirror walk --character kuka", "'kuka' has no clips"),
        (f"blend walk nowhere --output {tmp_path / 'b.json'}", "unknown clip 'nowhere'"),
    ):
        assert main(["motion", *words.split()]) == 1
        error = capsys.readouterr().err
        assert message in error and error.count("\n") == 1
    assert output.read_text() == ""
