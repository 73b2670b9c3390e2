"""Poses of a timeline as a character has them: by name and whole, mirrored, and at any time."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from actuated_characters.timeline.content import KEYS, Content, is_number
from actuated_characters.timeline.edits import SHORTEST_TIME
from character_motion.clips.mirroring import counterpart, mirrored_motion
from character_motion.clips.motion_clip import MotionClip
from controller_node.references.curve import Curve
from controller_node.references.files.keyframes import Keyframes
from controller_node.references.keyframes import curve_through
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.geometry import rotations

_IN = _OUT = 0.3  # s, of a layer that does not say


def values_of(
    character: Character, pose: GeneralizedPosition, joints: Iterable[str]
) -> dict[str, float]:
    """The degrees of freedom of some joints in a pose, by name; rad and m."""
    layout = character.layout
    wanted = layout.mask(joints)
    return {
        name: float(value)
        for name, value, is_wanted in zip(
            layout.dof_names, pose.position.tolist(), wanted, strict=True
        )
        if is_wanted
    }


def joints_of(character: Character, pose: Mapping[str, Any]) -> list[str]:
    """The joints of which a pose names a degree of freedom, in the layout's order."""
    joints = character.layout.joints
    return [joint.name for joint in joints if any(name in pose for name in joint.dof_names)]


def whole_poses(
    character: Character, poses: Sequence[Mapping[str, Any]]
) -> list[GeneralizedPosition]:
    """The poses of a layer, whole: what one leaves out is that of the pose before, or of rest.

    Names that are none of the character's, and what is no number, are left out.
    """
    position, whole = np.array(character.rest_position), []
    index_of = {name: index for index, name in enumerate(character.layout.dof_names)}
    for each in poses:
        for name, value in each["pose"].items():
            if name in index_of and is_number(value):
                position[index_of[name]] = value
        whole.append(character.layout.configuration(position.copy()))
    return whole


def mirrored(character: Character, pose: GeneralizedPosition) -> GeneralizedPosition:
    """A pose with left and right exchanged, in the plane y = 0.

    Raises:
        ClipError: the character is not its own image.
    """
    frame = GeneralizedPosition(pose.position[np.newaxis], pose.orientations_xyzw[np.newaxis])
    motion = mirrored_motion(MotionClip(character, np.zeros(1), frame))
    return GeneralizedPosition(motion.position[0], motion.orientations_xyzw[0])


def mirrored_values(
    character: Character, poses: Sequence[Mapping[str, Any]], number: int
) -> dict[str, float]:
    """A layer's pose mirrored, of the joints on the other side of those that it names.

    Raises:
        ClipError: the character is not its own image.
    """
    image = mirrored(character, whole_poses(character, poses)[number])
    named = joints_of(character, poses[number]["pose"])
    return values_of(character, image, (counterpart(character, name) for name in named))


class Preview:
    """The motion of a timeline's keys alone, over the rest pose.

    It leaves out clips, events and what physics makes of it: it is what an editor shows between
    keys until the timeline is run.
    """

    def __init__(self, character: Character, content: Content) -> None:
        self._character = character
        layers = [layer for layer in content.get(KEYS, []) if layer["poses"]]
        self._layers = [_Layer(character, layer) for layer in layers]

    def at(self, time: float) -> GeneralizedPosition:
        """The pose at a time in s."""
        layout = self._character.layout
        pose = layout.configuration(np.array(self._character.rest_position))
        for layer in self._layers:
            share = layer.share(time)
            if share > 0.0:
                wanted = layer.pose(time)
                step = np.where(layer.mask, share * layout.difference(pose, wanted), 0.0)
                pose = _moved(self._character, pose, step)
        return pose


class _Layer:
    """The motion through the poses of one layer, and how much of it counts when."""

    def __init__(self, character: Character, layer: Mapping[str, Any]) -> None:
        poses = layer["poses"]
        ways_in, ways_out = layer.get("in", _IN), layer.get("out", _OUT)
        self._in = float(ways_in) if is_number(ways_in) else _IN
        self._out = float(ways_out) if is_number(ways_out) else np.inf
        names = {name for each in poses for name in joints_of(character, each["pose"])}
        self.mask: BoolArray = character.layout.mask(names)
        self._curves = _curves(character, sorted(poses, key=lambda each: float(each["at"])))
        self._first, self._last = (float(call(each["at"] for each in poses)) for call in (min, max))

    def share(self, time: float) -> float:
        """How much the layer is above what lies beneath it, 0 to 1."""
        before, after = self._first - time, time - self._last
        if before > 0.0:
            return _eased(1.0 - before / self._in) if self._in > 0.0 else 0.0
        if after > 0.0 and np.isfinite(self._out):
            return _eased(1.0 - after / self._out) if self._out > 0.0 else 0.0
        return 1.0

    def pose(self, time: float) -> GeneralizedPosition:
        """Its pose at a time in s."""
        begun = [curve for curve in self._curves if curve.start <= time]
        return (begun[-1] if begun else self._curves[0]).sample(time).configuration


def _eased(share: float) -> float:
    """A share of 0 to 1 that begins and ends at rest; 0 below."""
    share = max(share, 0.0)
    return share * share * (3.0 - 2.0 * share)


def _curves(character: Character, poses: Sequence[Mapping[str, Any]]) -> list[Curve]:
    """The path through poses in parts, each at rest at both ends or a straight line."""
    rows = [
        row
        for row, each in enumerate(poses)
        if row == 0 or each["at"] - poses[row - 1]["at"] >= SHORTEST_TIME
    ]
    every = whole_poses(character, poses)
    whole = [every[row] for row in rows]
    times = np.array([float(poses[row]["at"]) for row in rows])
    eases = [poses[row].get("ease", "smooth") for row in rows]
    position = np.array([pose.position for pose in whole])
    turns = np.array([pose.orientations_xyzw for pose in whole])
    bounds, last = [0], len(rows) - 1
    for row in range(1, last):
        if eases[row] in ("rest", "linear") or eases[row - 1] == "linear":
            bounds.append(row)
    return [
        curve_through(
            character.layout,
            Keyframes(
                times[first : end + 1],
                GeneralizedPosition(position[first : end + 1], turns[first : end + 1]),
                smooth=eases[first] != "linear",
            ),
        )
        for first, end in zip(bounds, [*bounds[1:], last], strict=True)
    ]


def _moved(
    character: Character, pose: GeneralizedPosition, step: FloatArray
) -> GeneralizedPosition:
    """A pose after a step (n,) of it, a rotation's in the child frame."""
    entries = character.layout.rotation_entries
    position = pose.position + step
    turns = rotations.multiply(pose.orientations_xyzw, rotations.exp(step[entries]))
    position[entries] = rotations.log(turns)
    return GeneralizedPosition(position, turns)
