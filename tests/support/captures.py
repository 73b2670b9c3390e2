"""Files of motion capture as several makers write them, made from clips that are the truth.

A clip of the humanoid moves another skeleton: other proportions, another pose of zero rotations,
other names, axes, units and channels. The segments turn as the humanoid's do.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from actuated_characters.export.sources import of_clip
from tests.support.physics import character
from tests.support.rotation_matrices import about, euler, half_way, matrices

Floats = NDArray[np.float64]

Y_UP: Floats = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Of x ahead and z up: z ahead and y up, as most makers have it."""
Z_UP: Floats = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # -y ahead
X_UP: Floats = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
SIDES = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True)
class Proportions:
    """Lengths of a body in m."""

    hip_width: float = 0.095  # from the middle
    hip_drop: float = 0.06  # below the root's joint
    thigh: float = 0.42
    shank: float = 0.41
    ankle: float = 0.085  # over the ground
    toe: float = 0.14
    spine: float = 0.46  # from the root's joint to the neck
    neck: float = 0.09
    head: float = 0.17
    collar: float = 0.04  # from the middle
    shoulder_width: float = 0.18
    upper_arm: float = 0.28
    forearm: float = 0.25
    hand: float = 0.09


@dataclass(frozen=True)
class Maker:
    """How a maker of motion capture writes."""

    names: Mapping[str, str]  # of the joints, by part
    spine: tuple[str, ...] = ("Spine", "Spine1")  # from the root on, the last one carries the arms
    order: str = "ZXY"
    unit: float = 0.01  # m
    world: Floats = field(default_factory=lambda: Y_UP)
    rest: Floats = field(default_factory=lambda: Y_UP)  # axes of the pose of zero rotations
    yaw: float = 0.0  # rad about up
    arms: float = 0.0  # rad below the horizontal, at rest
    legs: float = 0.0  # rad to the side, at rest
    bent_frames: bool = False  # no pose at rest: each joint's axes are its own
    hip_joints: str = ""  # a joint of no rotation between root and thigh, such as `{L}HipJoint`
    above_root: str = ""  # a root that stands still above the hips
    positions: bool = False  # channels of position on every joint
    root_moves: bool = True
    first_rest: bool = False  # the pose of zero rotations comes first
    line_end: str = "\n"
    indent: str = "  "
    number: str = "{:.6f}"
    fingers: bool = False
    proportions: Proportions = Proportions()
    rate: float = 0.0  # Hz; 0: the clip's own
    noise: float = 0.0  # degrees


@lru_cache(maxsize=32)
def humanoid_motion(
    clip: str, rate: float, cycles: int = 1
) -> tuple[float, dict[str, Floats], Floats]:
    """Rate in Hz, turns since standing upright (f, 3, 3) by link, and the root's places (f, 3)."""
    whole = of_clip(character("humanoid"), clip)
    (trajectory,) = whole.characters
    rate = rate or whole.rate
    poses = whole.link_poses(trajectory, whole.sample_times(rate=rate))
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # of y-up links
    names = [link.name for link in trajectory.character.links]
    turns = {name: matrices(poses.turns_xyzw[:, row]) @ upright.T for row, name in enumerate(names)}
    return rate, turns, poses.origins[:, names.index("base")]


@dataclass
class _Node:
    name: str
    parent: int
    offset: Floats  # (3,) m, x ahead and z up, at rest
    turns: Floats  # (f, 3, 3) since rest
    ends: list[Floats] = field(default_factory=list)


def capture(
    path: Path, maker: Maker, clip: str = "walk", change: Callable[[Floats], Floats] | None = None
) -> Path:
    """Write a BVH file of a maker that shows a clip of the humanoid."""
    rate, turns, root = humanoid_motion(clip, maker.rate)
    nodes = _skeleton(maker, turns)
    size = maker.proportions
    scale = (size.thigh + size.shank) / (0.421546 + 0.40987)
    hips = scale * (root - (0.0, 0.0, 0.05)) + (0.0, 0.0, size.ankle)
    places = hips + turns["base"] @ np.array((0.0, 0.0, size.hip_drop))
    world = maker.world @ about(2, maker.yaw)
    own = [_own_axes(index) if maker.bent_frames else np.eye(3) for index in range(len(nodes))]
    globals_ = [
        world @ node.turns @ maker.rest.T @ frame for node, frame in zip(nodes, own, strict=True)
    ]
    columns: list[Floats] = []
    lines = ["HIERARCHY"]
    rng = np.random.default_rng(7)
    for index, node in enumerate(nodes):
        above = globals_[node.parent] if node.parent >= 0 else np.eye(3)
        local = np.swapaxes(above, -1, -2) @ globals_[index]
        angles = np.degrees(euler(local, maker.order))
        angles = angles + rng.normal(0.0, maker.noise, angles.shape)
        frame = own[node.parent] if node.parent >= 0 else np.eye(3)
        offset = frame.T @ maker.rest @ node.offset / maker.unit
        if (node.parent < 0 and maker.root_moves) or maker.positions:
            moving = (
                places @ world.T / maker.unit
                if node.parent < 0
                else np.tile(offset, (len(root), 1))
            )
            columns.append(np.broadcast_to(moving, (len(root), 3)))
        columns.append(angles)
    values = np.concatenate(columns, axis=1)
    if maker.first_rest:
        values = np.concatenate((np.zeros((1, values.shape[1])), values))
        if maker.root_moves:
            values[0, :3] = values[1, :3]
    if change is not None:
        values = change(values)
    lines += _hierarchy(maker, nodes, own)
    lines += ["MOTION", f"Frames:\t{len(values)}", f"Frame Time: {1.0 / rate:.7f}"]
    lines += [" ".join(maker.number.format(v) for v in row) for row in values]
    path.write_bytes((maker.line_end.join(lines) + maker.line_end).encode())
    return path


def _skeleton(maker: Maker, turns: Mapping[str, Floats]) -> list[_Node]:
    """The joints of a maker's skeleton, each after its parent, depth first."""
    size, names = maker.proportions, maker.names
    pelvis, chest, head = turns["base"], turns["chest"], turns["neck"]
    still = np.tile(np.eye(3), (len(pelvis), 1, 1))
    nodes: list[_Node] = []

    def add(
        name: str, parent: int, offset: tuple[float, float, float] | Floats, turn: Floats
    ) -> int:
        nodes.append(_Node(name, parent, np.array(offset, dtype=float), turn))
        return len(nodes) - 1

    root = -1
    if maker.above_root:
        root = add(maker.above_root, -1, (0.0, 0.0, 0.0), still)
    hips = add(names["hips"], root, (0.0, 0.0, 0.0), pelvis)
    for side, sign in SIDES.items():
        start = hips
        if maker.hip_joints:
            start = add(maker.hip_joints.format(L=side[0].upper()), hips, (0, 0, 0), pelvis)
        spread = about(0, -sign * maker.legs)
        down = np.array((0.0, sign * np.sin(maker.legs), -np.cos(maker.legs)))
        hip = add(
            names[f"{side}_hip"], start, (0.0, sign * size.hip_width, -size.hip_drop),
            turns[f"{side}_hip"] @ spread,
        )  # fmt: skip
        knee = add(names[f"{side}_knee"], hip, size.thigh * down, turns[f"{side}_knee"] @ spread)
        ankle = add(names[f"{side}_ankle"], knee, size.shank * down, turns[f"{side}_ankle"])
        toes = np.array((size.toe, 0.0, -size.ankle + 0.02))
        if f"{side}_toe" in names:
            toe = add(names[f"{side}_toe"], ankle, toes, turns[f"{side}_ankle"])
            nodes[toe].ends.append(np.array((0.06, 0.0, -0.01)))
        else:
            nodes[ankle].ends.append(toes)
    last = hips
    for number, name in enumerate(maker.spine, start=1):
        share = number / len(maker.spine)
        offset = (0.0, 0.0, size.spine / (len(maker.spine) + 1))
        last = add(name, last, offset, half_way(pelvis, chest, share))
    above = size.spine / (len(maker.spine) + 1)
    for side, sign in SIDES.items():
        lifted = about(0, -sign * (0.5 * np.pi - maker.arms))
        out = np.array((0.0, sign * np.cos(maker.arms), -np.sin(maker.arms)))
        start, place = last, np.array((0.0, sign * size.shoulder_width, above - 0.03))
        if f"{side}_collar" in names:
            inner = np.array((0.0, sign * size.collar, above - 0.05))
            start, place = add(names[f"{side}_collar"], last, inner, chest), place - inner
        arm = add(names[f"{side}_shoulder"], start, place, turns[f"{side}_shoulder"] @ lifted)
        elbow = add(
            names[f"{side}_elbow"], arm, size.upper_arm * out, turns[f"{side}_elbow"] @ lifted
        )
        wrist = add(
            names[f"{side}_wrist"], elbow, size.forearm * out, turns[f"{side}_elbow"] @ lifted
        )
        nodes[wrist].ends.append(size.hand * out)
        if maker.fingers:
            thumb = add(f"{names[f'{side}_wrist']}Thumb1", wrist, 0.03 * out, nodes[wrist].turns)
            nodes[thumb].ends.append(0.02 * out)
    neck = add(names["neck"], last, (0.0, 0.0, above), half_way(chest, head, 0.5))
    if "head" in names:
        neck = add(names["head"], neck, (0.0, 0.0, size.neck), head)
    nodes[neck].ends.append(np.array((0.0, 0.0, size.head)))
    return _depth_first(nodes)


def _depth_first(nodes: list[_Node]) -> list[_Node]:
    order: list[int] = []

    def visit(index: int) -> None:
        order.append(index)
        for child, node in enumerate(nodes):
            if node.parent == index:
                visit(child)

    visit(0)
    place = {old: new for new, old in enumerate(order)}
    result = [nodes[old] for old in order]
    for node in result:
        node.parent = place.get(node.parent, -1)
    return result


def _hierarchy(maker: Maker, nodes: list[_Node], own: list[Floats]) -> list[str]:
    lines: list[str] = []

    def text(offset: Floats) -> str:
        return " ".join(maker.number.format(v) for v in offset / maker.unit)

    def write(index: int, depth: int) -> None:
        node, tab = nodes[index], maker.indent
        frame = own[node.parent] if node.parent >= 0 else np.eye(3)
        lines.append(f"{tab * depth}{'ROOT' if node.parent < 0 else 'JOINT'} {node.name}")
        lines.append(tab * depth + "{")
        inside = tab * (depth + 1)
        lines.append(f"{inside}OFFSET {text(frame.T @ maker.rest @ node.offset)}")
        moves = (node.parent < 0 and maker.root_moves) or maker.positions
        channels = ["Xposition", "Yposition", "Zposition"] if moves else []
        channels += [f"{axis}rotation" for axis in maker.order]
        lines.append(f"{inside}CHANNELS {len(channels)} {' '.join(channels)}")
        for child, below in enumerate(nodes):
            if below.parent == index:
                write(child, depth + 1)
        for end in node.ends:
            lines.extend((inside + "End Site", inside + "{"))
            lines.append(f"{inside}{tab}OFFSET {text(own[index].T @ maker.rest @ end)}")
            lines.append(inside + "}")
        lines.append(tab * depth + "}")

    write(0, 0)
    return lines


def _own_axes(index: int) -> Floats:
    """The axes of a joint of its own, any."""
    return about(2, 0.7 * index) @ about(0, 1.3 + 0.4 * index) @ about(1, 0.9 * index)
