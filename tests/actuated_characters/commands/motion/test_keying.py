"""`motion keys`: the written file is near the clip, at its frames and halfway between them."""

import math
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.cli import main
from controller_node.references.files.keyframes import Keyframes, read_keyframes
from controller_node.references.keyframes import KeyframesReference
from msgs_config.arrays import FloatArray
from msgs_config.clips.reading import ClipFrames, available_clips, read_clip
from tests.support.physics import character

HUMANOID = character("humanoid")
# keys of those that are too fast for their frames; of the others a fifth of the frames will do
_MOST = {"backflip": 21, "kick": 14, "run": 11, "spin": 33, "spinkick": 17}
_NIGHTLY = pytest.mark.nightly


def worst(clip: ClipFrames, keyframes: Keyframes) -> tuple[float, float]:
    """The largest angle in rad and way in m at all frames and halfway between two of them.

    Measured from the frames' own quaternions: halfway is their normalised sum.
    """
    reference, layout = KeyframesReference(HUMANOID.layout, keyframes), HUMANOID.layout
    hinges = [j.start for j in layout.joints if j.rotation is None]
    angle = place = 0.0
    for row in range(2 * len(clip.times) - 1):
        a, b = row // 2, (row + 1) // 2
        time = 0.5 * (clip.times[a] + clip.times[b])
        state = reference.sample(float(time)).configuration
        first, second = clip.orientations_xyzw[a], clip.orientations_xyzw[b]
        nearer = np.where((first * second).sum(axis=1, keepdims=True) < 0.0, -second, second)
        middle = first + nearer
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        cosines = np.abs((middle * state.orientations_xyzw).sum(axis=1))
        angle = max(angle, *(2.0 * math.acos(min(cosine, 1.0)) for cosine in cosines.tolist()))
        position = 0.5 * (clip.positions[a] + clip.positions[b])
        angle = max(angle, *np.abs(state.position - position)[hinges].tolist())
        place = max(place, float(np.linalg.norm((state.position - position)[:3])))
    return angle, place


def positions_of(keyframes: Keyframes) -> FloatArray:
    return keyframes.configurations.position


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("jump", "walk") else _NIGHTLY)
        for name in available_clips(HUMANOID)
    ],
)
def test_the_path_of_the_file_is_within_the_tolerances(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    output = tmp_path / "keys.yaml"

    assert main(["motion", "keys", name, "--output", str(output)]) == 0

    printed = capsys.readouterr().out
    clip, keyframes = read_clip(HUMANOID, name), read_keyframes(HUMANOID, str(output))
    angle, place = worst(clip, keyframes)
    assert angle <= 0.05 and place <= 0.01
    assert f"{angle:.3g} rad" in printed and f"{1e3 * place:.3g} mm" in printed
    if name not in _MOST:
        assert len(keyframes.times) <= len(clip.times) / 5
        assert "more than a fifth" not in printed
    else:
        assert len(keyframes.times) <= _MOST[name]
        assert "keys are more than a fifth of the frames" in printed


@pytest.mark.slow
def test_a_cycle_on_the_spot_is_a_loop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cycle, output = tmp_path / "cycle.json", tmp_path / "keys.yaml"
    words = ["motion", "loop", "dance_b", "--from", "0.5", "--to", "1.5", "--output", str(cycle)]
    assert main(words) == 0
    _stay(cycle)

    assert main(["motion", "keys", str(cycle), "--output", str(output), "--angle", "0.1"]) == 0

    assert "a loop of 1 s" in capsys.readouterr().out
    keyframes, clip = read_keyframes(HUMANOID, str(output)), read_clip(HUMANOID, str(cycle))
    assert keyframes.period == pytest.approx(clip.times[-1], abs=1e-6)
    angle, place = worst(clip, keyframes)
    assert angle <= 0.1 and place <= 0.01


def _stay(file: Path) -> None:
    """Have a cycle end at the place and with the heading with which it began."""
    from dataclasses import replace

    from character_motion.clips.motion_clip import read_motion_clip
    from msgs_config.character.layout import GeneralizedPosition

    clip = read_motion_clip(HUMANOID, str(file))
    position, turns = clip.motion.position.copy(), clip.motion.orientations_xyzw.copy()
    share = (clip.times / clip.duration)[:, np.newaxis]
    position[:, :2] += share * (position[0, :2] - position[-1, :2])
    turns[:, 0] = turns[0, 0]
    replace(clip, motion=GeneralizedPosition(position, turns)).write(file)


def test_a_clip_of_two_frames_and_no_base_has_two_keys(tmp_path: Path) -> None:
    output = tmp_path / "keys.yaml"
    clip = tmp_path / "kuka.json"
    kuka = character("kuka")
    frame = [0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, *([0.1] * len(kuka.layout.joints))]
    clip.write_text(f'{{"Loop": "none", "Frames": {[frame, frame]}}}')

    words = ["motion", "keys", str(clip), "--character", "kuka", "--output", str(output)]
    assert main(words) == 0

    keyframes = read_keyframes(kuka, str(output))
    assert keyframes.times.tolist() == [0.0, 0.5]
    assert positions_of(keyframes) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("--angle 0", "--angle is 0 rad; it must be more than 0"),
        ("--place -0.1", "--place is -0.1 m; it must be more than 0"),
        ("--character nobody", "unknown character 'nobody'"),
        ("--output keys.json", "--output keys.json: it must end in .yaml"),
        ("--output made.yaml", "made.yaml exists already; --overwrite replaces it"),
    ],
)
def test_mistakes_are_told_in_a_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: str,
    error: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("made.yaml").write_text("mine")

    assert main(["motion", "keys", "walk", *words.split()]) == 1

    printed = capsys.readouterr().err
    assert error in printed and printed.count("\n") == 1
    assert Path("made.yaml").read_text() == "mine" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.slow
def test_a_folder_of_clips_becomes_one_of_keys(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clips, keys = tmp_path / "clips", tmp_path / "keys"
    for name in ("walk", "run"):
        output = clips / f"{name}.json"
        assert main(["motion", "trim", name, "--to", "0.4", "--output", str(output)]) == 0

    assert main(["motion", "keys", str(clips), "--output", str(keys), "--angle", "0.2"]) == 0

    assert sorted(path.name for path in keys.iterdir()) == ["run.yaml", "walk.yaml"]
    assert "keys of clips" in capsys.readouterr().out
