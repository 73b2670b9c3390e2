"""The text of keys is what the reader of keyframes takes."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.keys.keyframes_file import keyframes_text
from controller_node.references.files.keyframes import Keyframes, read_keyframes
from msgs_config.character.layout import JointLayout, JointType
from tests.support.physics import character


@pytest.mark.parametrize("period", [None, 1.5])
def test_what_is_written_is_read(tmp_path: Path, period: float | None) -> None:
    humanoid = character("humanoid")
    layout = humanoid.layout
    position = np.round(np.random.default_rng(3).uniform(-0.5, 0.5, (3, layout.size)), 4)
    lower, upper = humanoid.position_bounds()
    position = np.clip(position, np.round(lower, 4), np.round(upper, 4))
    position[1:, layout.joint("chest").entries] = position[0, layout.joint("chest").entries]
    keyframes = Keyframes(
        np.array([0.0, 0.125, 1.2]), layout.configuration(position), smooth=True, period=period
    )
    file = tmp_path / "keys.yaml"

    text = keyframes_text(layout, keyframes, "two\nlines")
    file.write_text(text)

    assert text.startswith("# two\n# lines\n") and text.count("chest_x") == 1
    read = read_keyframes(humanoid, str(file))
    assert read.times.tolist() == [0.0, 0.125, 1.2] and read.smooth and read.period == period
    assert read.configurations.position == pytest.approx(position, abs=1e-12)


def test_small_numbers_have_no_exponent_and_odd_names_are_quoted() -> None:
    layout = JointLayout([("on", JointType.REVOLUTE), ("a: b", JointType.PRISMATIC)])
    pose = layout.configuration(np.array([[0.0001, -0.00001]]))

    text = keyframes_text(layout, Keyframes(np.array([0.0]), pose, smooth=False), "")

    assert '{"on": 0.0001,\n' in text and '"a: b": 0.0}' in text
    assert "interpolation: linear" in text
