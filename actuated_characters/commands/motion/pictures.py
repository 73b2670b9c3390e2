"""A strip of pictures of a retargeted motion: the captured skeleton beside the character."""

import numpy as np

from actuated_characters.render.captions import captioned
from actuated_characters.render.engine.camera_pose import CameraPose, Size, Spheres, framing
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from actuated_characters.render.stills import side_by_side
from character_motion.retargeting.retargeting import RetargetedMotion
from character_motion.retargeting.target_body import TargetBody
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

_COUNT = 6
_SIZE: Size = (330, 300)
_BESIDE = 1.0  # m to the character's right, where the captured skeleton is drawn
_BONE, _JOINT = 0.018, 0.028  # m, radii
_COLORS = {"left": (40, 110, 200), "right": (214, 96, 40), "": (90, 90, 90)}
_VIEW = CameraPose(yaw=1.1, pitch=0.15)


def comparison_strip(target: TargetBody, made: RetargetedMotion, count: int = _COUNT) -> Picture:
    """Pictures (h, w, 3) at equal steps of time; each follows the body along the ground.

    The captured skeleton is in the character's size, its left blue and its right orange.
    """
    frames = np.unique(np.linspace(0, made.source.frames - 1, count).round().astype(int))
    layout = target.character.layout
    tiles = []
    renderer = Renderer(target.character)
    for frame in frames.tolist():
        position = made.motion.position[frame].copy()
        position[layout.rotation_entries] = rotations.log(made.motion.orientations_xyzw[frame])
        nodes = made.source.positions[frame] + np.array((0.0, -_BESIDE, 0.0))
        here = np.array((*position[:2], 0.0))
        position[:2], nodes = 0.0, nodes - here
        bodies = renderer.posed.spheres(renderer.posed.frames(position))
        captured = Spheres(nodes, np.full(len(nodes), _JOINT))
        view = framing(Spheres.joined((bodies, captured)), _SIZE[0] / _SIZE[1], _VIEW)
        picture = renderer.picture(FrameSpec(position, view), _SIZE)
        drawn = _with_skeleton(picture, view, made, nodes)
        tiles.append(captioned(drawn, f"{frame * made.source.frame_time:.2f} s"))
    return side_by_side(tiles, len(tiles))


def _with_skeleton(
    picture: Picture, view: CameraPose, made: RetargetedMotion, nodes: FloatArray
) -> Picture:
    """A picture with the bones of the captured skeleton, the farthest first."""
    eye = view.eye()
    bones = [(node, parent) for node, parent in enumerate(made.source.parents) if parent >= 0]
    bones.sort(key=lambda bone: -float(np.linalg.norm(nodes[list(bone)].mean(axis=0) - eye)))
    sides = _sides(made)
    drawn = picture.astype(float)
    for node, parent in bones:
        _draw_bone(drawn, view, nodes[parent], nodes[node], _COLORS[sides[node]])
    painted: Picture = np.rint(drawn).astype(np.uint8)
    return painted


def _sides(made: RetargetedMotion) -> list[str]:
    """The side of each node: that of the joint of the map that it hangs on."""
    named = {index: role for role, index in made.source.map.joints.items()}
    sides: list[str] = []
    for node, parent in enumerate(made.source.parents):
        side = named.get(node, "").partition("_")[0]
        inherited = sides[parent] if parent >= 0 else ""
        sides.append(side if side in ("left", "right") else inherited)
    return sides


def _draw_bone(
    picture: FloatArray, view: CameraPose, start: FloatArray, end: FloatArray, color: object
) -> None:
    """Draw a capsule on a picture (h, w, 3), with smooth edges and a round shade."""
    height, width, _ = picture.shape
    (a, b), depth = _seen(view, np.array((start, end)), height, width)
    radius = _BONE / (view.pixel(height) * depth.mean())
    low = np.floor(np.minimum(a, b) - radius - 1.0).astype(int).clip(0)
    high = np.ceil(np.maximum(a, b) + radius + 2.0).astype(int)
    rows, columns = np.mgrid[low[0] : min(high[0], height), low[1] : min(high[1], width)]
    if not rows.size:
        return
    points = np.stack((rows, columns), axis=-1) - a
    along = b - a
    share = (points @ along / max(float(along @ along), 1e-9)).clip(0.0, 1.0)
    away = np.linalg.norm(points - share[..., np.newaxis] * along, axis=-1)
    cover = np.clip(radius + 0.5 - away, 0.0, 1.0)[..., np.newaxis]
    shade = np.sqrt(np.clip(1.0 - (away / (radius + 0.5)) ** 2, 0.15, 1.0))[..., np.newaxis]
    part = picture[low[0] : min(high[0], height), low[1] : min(high[1], width)]
    part += cover * (np.array(color) * shade - part)


def _seen(
    view: CameraPose, points: FloatArray, height: int, width: int
) -> tuple[FloatArray, FloatArray]:
    """Row and column (m, 2) at which points (m, 3) are seen, and their depths (m,), m."""
    across, upwards, back = view.axes() @ (points - view.eye()).T
    scale = -1.0 / (view.pixel(height) * back)
    return np.stack((0.5 * height - scale * upwards, 0.5 * width + scale * across), axis=-1), -back
