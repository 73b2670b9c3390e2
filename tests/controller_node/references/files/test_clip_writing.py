"""Clips that are written, read again."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Placement
from msgs_config.clips.reading import read_clip
from msgs_config.clips.writing import clip_rows, clip_text
from tests.support.physics import character


@pytest.mark.parametrize(("name", "clip"), [("humanoid", "spin"), ("laikago", "walk")])
def test_what_is_written_is_read_again(tmp_path: Path, name: str, clip: str) -> None:
    whole = character(name)
    frames = read_clip(whole, clip)
    motion = GeneralizedPosition(frames.positions, frames.orientations_xyzw)
    file = tmp_path / "a.json"

    rows = clip_rows(whole, frames.times, motion)
    file.write_text(clip_text(rows, wraps=frames.wraps, known={"Source": {"file": "a"}}))

    again = read_clip(whole, str(file))
    assert again.wraps == frames.wraps
    np.testing.assert_allclose(again.times, frames.times, atol=1e-5)
    apart = whole.layout.difference(
        motion, GeneralizedPosition(again.positions, again.orientations_xyzw)
    )
    np.testing.assert_allclose(apart, 0.0, atol=1e-6)


def test_a_character_that_was_moved_is_not_written() -> None:
    whole = character("humanoid")
    frames = read_clip(whole, "walk")
    motion = GeneralizedPosition(frames.positions, frames.orientations_xyzw)

    with pytest.raises(ValueError, match="where its file puts it"):
        clip_rows(whole.placed(Placement(x=1.0)), frames.times, motion)
