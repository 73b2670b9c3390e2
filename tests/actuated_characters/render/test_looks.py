"""Pictures look as those that another renderer drew, and are the same on every machine."""

from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from PIL import Image

from actuated_characters.render.engine import rasteriser
from actuated_characters.render.engine.camera_pose import CameraPose
from actuated_characters.render.engine.posed_characters import LinkForce
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from msgs_config.character.model import Pose, Shape, ShapeType
from tests.support.physics import character

DATA = Path(__file__).parents[2] / "data" / "tinyrenderer"
"""By PyBullet 3.2.7's software renderer, which has its samples in the corners of pixels."""
SIZE = (240, 180)
SCENES = ("humanoid", "laikago")
HASH = "fe89643a4098fd1c48f47ee1cf2679d35c42aef5737ab3f710da0ff0d6114b3c"  # of the humanoid's


def take(name: str) -> Picture:
    """The picture of a scene: ghost, ball, force, marked link and shadow, or meshes and texture."""
    whole = character(name)
    rest = np.array(whole.rest_position)
    view = CameraPose((0.0, 0.0, 0.45 * 1.6), distance=4.2, yaw=0.6, pitch=0.25)
    if name == "laikago":
        near = CameraPose((0.0, 0.0, 0.3), distance=1.8, yaw=0.6, pitch=0.25)
        return Renderer(whole).picture(FrameSpec(rest, near), SIZE)
    ghost = rest + np.concatenate(((0.3, 0.5, 0.0), np.full(len(rest) - 3, 0.1)))
    touching = np.zeros(len(whole.links), dtype=np.bool_)
    touching[2] = True
    frame = FrameSpec(
        rest,
        view,
        ghost=ghost,
        forces=[LinkForce(1, np.zeros(3), np.array((0.6, 0.5, -0.2)))],
        touching=touching,
        balls=[Shape(ShapeType.SPHERE, (0.2,), Pose((-0.7, -0.4, 1.1)))],
    )
    return Renderer(whole).picture(frame, SIZE)


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_looks_as_another_renderer_draws_it(name: str) -> None:
    with Image.open(DATA / f"{name}.png") as image:
        theirs = np.array(image).astype(int)

    ours = take(name).astype(int)

    assert np.abs(ours - theirs).mean() < 1.5
    # where edges lie by half a sample elsewhere, a pixel is like one beside it
    around = sliding_window_view(np.pad(theirs, ((1, 1), (1, 1), (0, 0)), "edge"), (3, 3), (0, 1))
    lowest, highest = around.min(axis=(-1, -2)), around.max(axis=(-1, -2))
    outside = np.maximum(lowest - ours, ours - highest).max(axis=2)
    assert (outside > 4).mean() < 0.003


def test_a_picture_has_the_same_bits_everywhere() -> None:
    assert sha256(take("humanoid").tobytes()).hexdigest() == HASH


def test_whatever_is_drawn_is_compiled_once() -> None:
    for name in SCENES:
        take(name)

    for function in (rasteriser.draw_triangles, rasteriser.add_shadow):
        assert len(function.signatures) == 1
