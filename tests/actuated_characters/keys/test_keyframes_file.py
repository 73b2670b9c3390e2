"""The text of keys is what the reader of keyframes takes."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.keys.keyframes_file import keyframes_text, timeline_text
from controller_node import parameters as for_controller
from controller_node.references.files.keyframes import Keyframes, read_keyframes
from controller_node.references.keyframes import KeyframesReference
from controller_node.references.timeline.file import read_timeline
from controller_node.references.timeline.motion import timeline_motion
from msgs_config.character.layout import JointLayout, JointType
from tests.support.motion import assert_same_motion, random_knots
from tests.support.physics import character


@pytest.mark.parametrize("period", [None, 1.5])
def test_what_is_written_is_read(tmp_path: Path, period: float | None) -> None:
    humanoid = character("humanoid")
    layout = humanoid.layout
    position = np.round(np.random.default_rng(3).uniform(-0.5, 0.5, (3, layout.size)), 4)
    lower, upper = humanoid.position_bounds()
    position = np.clip(position, np.round(lower, 4), np.round(upper, 4))
    position[1:, layout.joint("chest").entries] = position[0, layout.joint("chest").entries]
    velocities = np.full_like(position, np.nan)
    velocities[1, layout.joint("chest").entries] = (0.5, -2.0, 0.0)
    velocities[2, layout.joint("right_knee").entries] = -1.25
    accelerations = np.full_like(position, np.nan)
    accelerations[1, layout.joint("chest").entries] = (-8.0, 0.0, 12.5)
    times, whole = np.array([0.0, 0.125, 1.2]), layout.configuration(position)
    keyframes = Keyframes(times, whole, True, period, velocities, accelerations)
    file = tmp_path / "keys.yaml"

    text = keyframes_text(layout, keyframes, "two\nlines")
    file.write_text(text)

    assert text.startswith("# two\n# lines\n") and text.count("chest_x") == 3
    assert text.count("velocity: {") == 2
    read = read_keyframes(humanoid, str(file))
    assert read.times.tolist() == [0.0, 0.125, 1.2] and read.smooth and read.period == period
    assert read.configurations.position == pytest.approx(position, abs=1e-12)
    np.testing.assert_array_equal(read.velocities, velocities)
    np.testing.assert_array_equal(read.accelerations, accelerations)


def test_as_a_timeline_they_move_as_keyframes_do(tmp_path: Path) -> None:
    humanoid = character("humanoid")
    layout = humanoid.layout
    knots = random_knots(humanoid, np.array([0.0, 0.5, 0.75, 1.25]))
    rounded = layout.configuration(np.round(knots.configurations.position, 4))
    assert knots.velocities is not None
    velocities = np.round(knots.velocities, 4)
    velocities[1, layout.joint("chest").entries] = np.nan
    accelerations = 5.0 * velocities[::-1]
    keyframes = Keyframes(knots.times, rounded, True, None, velocities, accelerations)
    file = tmp_path / "keys.yaml"

    file.write_text(timeline_text(layout, keyframes, "a clip", "humanoid"))

    values = for_controller.resolve_for(
        humanoid, {"character": "humanoid", "reference": "timeline", "timeline": str(file)}
    )
    timeline = timeline_motion(humanoid, values, read_timeline(str(file))).reference
    alone = KeyframesReference(layout, keyframes)
    for time in np.linspace(0.0, 1.5, 31).tolist():
        assert_same_motion(layout, timeline.sample(time), alone.sample(time), atol=1e-9)


def test_small_numbers_have_no_exponent_and_odd_names_are_quoted() -> None:
    layout = JointLayout([("on", JointType.REVOLUTE), ("a: b", JointType.PRISMATIC)])
    pose = layout.configuration(np.array([[0.0001, -0.00001]]))

    text = keyframes_text(layout, Keyframes(np.array([0.0]), pose, smooth=False), "")

    assert '{"on": 0.0001,\n' in text and '"a: b": 0.0}' in text
    assert "interpolation: linear" in text
