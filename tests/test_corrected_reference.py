"""A motion with corrections, in time and as a file."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from physics import character

from controller_node.motion import make_motion
from controller_node.parameters import PARAMETERS, character_parameters
from controller_node.references.base import ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.clip_file import clip_path, read_clip
from controller_node.references.corrected import CorrectedReference, Corrections, Offset
from controller_node.references.corrected_file import (
    read_corrections,
    read_reconstruction,
    write_corrected,
)
from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.errors import ClipError
from msgs_config.joint_layout import Configuration
from msgs_config.parameters import resolve

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
WALK = ClipReference(LAYOUT, read_clip(HUMANOID, "walk"))
CORRECTED = ("chest", "right_hip", "right_knee", "left_ankle")
ENDS = (0.1, 0.25)


def some_offsets(count: int, size: float = 0.4) -> FloatArray:
    """Offsets (w, n) of some joints."""
    rng = np.random.default_rng(1)
    return np.where(LAYOUT.mask(CORRECTED), rng.uniform(-size, size, (count, LAYOUT.size)), 0.0)


def corrected(offsets: FloatArray) -> CorrectedReference:
    return CorrectedReference(LAYOUT, WALK, Corrections(ENDS, offsets))


def numbers(state: ReferenceState) -> bytes:
    """All of a state's doubles."""
    arrays = (state.configuration.position, state.configuration.orientations_xyzw)
    return b"".join(array.tobytes() for array in (*arrays, state.velocity, state.acceleration))


@pytest.mark.parametrize(
    ("time", "window"),
    [
        (0.0, None),
        (1e-9, 0),
        (0.1, 0),
        (0.1 + 1e-9, 1),
        (0.25, 1),
        (0.25 + 1e-9, None),
        (9.0, None),
    ],
)
def test_an_offset_counts_after_its_windows_first_moment_up_to_its_last(
    time: float, window: int | None
) -> None:
    offsets = some_offsets(2)

    state, motion = corrected(offsets).sample(time), WALK.sample(time)

    moved = LAYOUT.difference(motion.configuration, state.configuration)
    wanted = np.zeros(LAYOUT.size) if window is None else offsets[window]
    np.testing.assert_allclose(moved, wanted, rtol=0.0, atol=1e-14)


def test_positions_and_orientations_are_the_same_rotations() -> None:
    state = corrected(some_offsets(2, size=2.0)).sample(0.2)

    turned = rotations.exp(state.configuration.position[LAYOUT.rotation_entries])
    angles = rotations.angle_between(turned, state.configuration.orientations_xyzw)
    assert angles.max() < 1e-14


def test_its_velocity_is_the_rate_at_which_it_moves() -> None:
    reference, instant = corrected(some_offsets(2)), 1e-6

    before, after = reference.sample(0.2 - instant), reference.sample(0.2 + instant)

    moved = LAYOUT.difference(before.configuration, after.configuration)
    rate = moved / (2.0 * instant)
    np.testing.assert_allclose(rate, reference.sample(0.2).velocity, rtol=0.0, atol=1e-6)


def test_a_table_of_states_gets_the_doubles_that_each_of_them_gets() -> None:
    times = np.arange(1, 25) / 240.0
    states = [WALK.sample(time) for time in times]
    table = ReferenceState(
        Configuration(
            np.array([state.configuration.position for state in states]),
            np.array([state.configuration.orientations_xyzw for state in states]),
        ),
        np.array([state.velocity for state in states]),
        np.array([state.acceleration for state in states]),
    )
    for offset in some_offsets(20):
        made = Offset(LAYOUT, offset)

        together = made.applied(table)

        for row, state in enumerate(states):
            alone = made.applied(state)
            configuration = together.configuration
            one = Configuration(configuration.position[row], configuration.orientations_xyzw[row])
            found = ReferenceState(one, together.velocity[row], together.acceleration[row])
            assert numbers(found) == numbers(alone)


def test_without_offsets_it_is_the_motion() -> None:
    state, motion = corrected(np.zeros((2, LAYOUT.size))).sample(0.2), WALK.sample(0.2)

    assert numbers(state) == numbers(motion)


# The file


def written(directory: Path, offsets: FloatArray) -> Path:
    path = directory / "walk.json"
    corrections = Corrections(ENDS, offsets)
    write_corrected(path, clip_path(HUMANOID, "walk"), LAYOUT, corrections, {"seed": 7})
    return path


def test_a_file_gives_back_the_same_doubles(tmp_path: Path) -> None:
    offsets = some_offsets(2)

    read = read_corrections(HUMANOID, str(written(tmp_path, offsets)))

    assert read is not None
    assert read.ends == ENDS
    assert read.offsets.tobytes() == (offsets + 0.0).tobytes()
    assert read_reconstruction(tmp_path / "walk.json") == {"seed": 7}
    assert [path.name for path in tmp_path.iterdir()] == ["walk.json"]


def test_a_file_is_tracked_as_a_clip(tmp_path: Path) -> None:
    offsets = some_offsets(2)
    values = resolve(
        PARAMETERS + character_parameters(HUMANOID),
        {"reference": "clip", "clip": str(written(tmp_path, offsets))},
    )

    reference = make_motion(HUMANOID, values).reference

    for time in (0.0, 0.05, 0.2, 1.0, 3.0):
        assert numbers(reference.sample(time)) == numbers(corrected(offsets).sample(time))


@pytest.mark.parametrize("clip", ["walk", "clip.json"])
def test_a_clip_without_corrections_has_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clip: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "clip.json").write_text('{"Loop": "none", "Frames": [[1], [1]]}')

    assert read_corrections(HUMANOID, clip) is None


def without(key: str) -> Callable[[dict[str, Any]], object]:
    return lambda content: content["Corrections"].pop(key)


def setting(key: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda content: content["Corrections"].update({key: value})


def renamed(name: str) -> Callable[[dict[str, Any]], object]:
    return lambda content: content["Corrections"]["dofs"].__setitem__(0, name)


def first_offset(value: object) -> Callable[[dict[str, Any]], object]:
    return lambda content: content["Corrections"]["offsets"][0].__setitem__(0, value)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (without("dofs"), "must have 'dofs', 'ends' and 'offsets'"),
        (without("offsets"), "must have 'dofs', 'ends' and 'offsets'"),
        (setting("ends", [0.1, "x"]), "must have 'dofs', 'ends' and 'offsets'"),
        (setting("ends", [0.1]), r"offsets are \(2, 10\); they must be"),
        (setting("ends", [0.2, 0.1]), "ends must rise"),
        (setting("ends", [0.0, 0.1]), "ends must rise"),
        (setting("ends", [0.1, float("nan")]), "ends must rise"),
        (setting("dofs", ["root_x"] * 10), "named twice"),
        (renamed("tail"), "unknown degree of freedom 'tail'"),
        (first_offset(float("inf")), "an offset is not finite"),
        (first_offset(1e9), "an offset is not finite, or over 1000"),
        (lambda content: content.update(Corrections=7), "must have 'dofs'"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(
    tmp_path: Path, change: Callable[[dict[str, Any]], object], reason: str
) -> None:
    path = written(tmp_path, some_offsets(2))
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))

    with pytest.raises(ClipError, match=reason) as error:
        read_corrections(HUMANOID, str(path))

    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_the_root_cannot_be_corrected(tmp_path: Path) -> None:
    path = written(tmp_path, some_offsets(2))
    content = json.loads(path.read_text())
    root = [f"root_{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")]
    content["Corrections"].update(dofs=root, offsets=[[0.0] * 6] * 2)
    path.write_text(json.dumps(content))

    with pytest.raises(ClipError, match="'root' is corrected"):
        read_corrections(HUMANOID, str(path))


@pytest.mark.parametrize("text", ["", "[", "[1, 2]", "7"])
def test_a_file_that_is_no_clip_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "walk.json"
    path.write_text(text)

    with pytest.raises(ClipError, match="not a motion clip"):
        read_corrections(HUMANOID, str(path))


def test_a_clip_is_no_reconstruction(tmp_path: Path) -> None:
    path = tmp_path / "clip.json"
    path.write_text('{"Loop": "none", "Frames": []}')

    with pytest.raises(ClipError, match="not a corrected motion"):
        read_reconstruction(path)
