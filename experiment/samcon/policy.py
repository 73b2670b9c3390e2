"""What acts without a search, and as a vector of numbers: a feedback, and a cycle's offsets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from controller_node.feedback_gains import OUTPUTS
from experiment.samcon.problem import Problem
from experiment.samcon.settings import Rows
from msgs_config.arrays import FloatArray
from msgs_config.character import Character, Joint
from msgs_config.joint_layout import JointType

Gains: TypeAlias = Mapping[str, float]
"""Gains of the feedback by name."""

Offsets: TypeAlias = Mapping[str, Rows]
"""Offsets by joint, as `Settings.offsets`."""

_USUAL = {"centre_vx": 0.2, "centre_vy": 0.2, "centre_vz": 0.2, "one": 0.1, "side": 0.1}
_SPIN = 0.2
_OFFSET = 0.2  # rad
_DIGITS = 3  # of gains, as they stand in files
_RIGHT, _LEFT = "right_", "left_"

# what has something to do with what: about x it leans sideways, about y it turns, about z ahead
_SIDEWAYS = ("centre_y", "centre_vy", "arm_y", "tilt_x", "spin_x", "one")
_AHEAD = ("centre_x", "centre_vx", "arm_x", "tilt_z", "spin_z", "one")
_CANDIDATES = {
    "hip_x": _SIDEWAYS,
    "hip_y": ("centre_y", "tilt_y", "spin_y"),
    "hip_z": _AHEAD,
    "knee": ("centre_z", "centre_vz", "one"),
    "ankle_x": _SIDEWAYS,
    "ankle_y": ("tilt_y", "spin_y"),
    "ankle_z": _AHEAD,
}


@dataclass(frozen=True)
class Policy:
    """What acts without a search."""

    feedback: Gains
    offsets: Offsets = field(default_factory=dict)


def names() -> tuple[str, ...]:
    """The gains that are fitted."""
    assert set(_CANDIDATES) == set(OUTPUTS)
    return tuple(
        f"{leg}.{output}.{feature}"
        for leg in ("stance", "swing")
        for output, features in _CANDIDATES.items()
        if leg == "stance" or not output.startswith("ankle")
        for feature in features
    )


class PolicySpace:
    """Policies as vectors whose entries are about 1 where they are usual.

    Of a motion that wraps, with an even number of windows a cycle, a vector has the legs' offsets
    in half of them; the other half mirrors these.
    """

    def __init__(self, problem: Problem, character: Character, windows: int) -> None:
        """`windows` are those of a cycle; 0: offsets are left as they are."""
        self._names = tuple(dict.fromkeys((*names(), *problem.feedback)))
        self._usual = np.array([_usual(name) for name in self._names])
        self._given = problem.offsets
        self._half = 0 if windows % 2 else windows // 2
        self._pairs = _pairs(character)

    def vector(self, policy: Policy) -> FloatArray:
        """A policy's vector."""
        gains = np.array([policy.feedback.get(name, 0.0) for name in self._names]) / self._usual
        rows = [
            np.ravel(policy.offsets[name][window])
            if name in policy.offsets
            else np.zeros(_width(joint))
            for window in range(self._half)
            for name, joint in self._pairs
        ]
        return np.concatenate((gains, *(row / _OFFSET for row in rows)))

    def policy(self, vector: FloatArray) -> Policy:
        """A vector's policy, in as many digits as files have."""
        count = len(self._names)
        values = (vector[:count] * self._usual).tolist()
        gains = {
            name: float(f"{value:.{_DIGITS}g}")
            for name, value in zip(self._names, values, strict=True)
        }
        if not self._half:
            return Policy(gains, self._given)
        numbers = iter(np.round(_OFFSET * vector[count:], _DIGITS).tolist())
        halves = [
            {name: [next(numbers) for _ in range(_width(joint))] for name, joint in self._pairs}
            for _ in range(self._half)
        ]
        cycle = [*halves, *(_mirrored(half) for half in halves)]
        return Policy(gains, {name: [row[name] for row in cycle] for name, _ in self._pairs})


def _pairs(character: Character) -> list[tuple[str, Joint]]:
    """The joints of the legs, as far as there are two of a kind."""
    joints = {joint.name: joint for joint in character.moving_joints}
    found = []
    for foot in character.feet:
        link = [link.name for link in character.links].index(foot)
        while link > 0:
            joint = character.links[link].joint
            if joint.name in joints and _other(joint.name) in joints:
                found.append((joint.name, joint))
            link = character.links[link].parent
    return found


def _width(joint: Joint) -> int:
    return 3 if joint.type is JointType.SPHERICAL else 1


def _other(name: str) -> str:
    """The joint of the other side, by its name; the joint itself if there is none."""
    if name.startswith(_RIGHT):
        return _LEFT + name.removeprefix(_RIGHT)
    return _RIGHT + name.removeprefix(_LEFT) if name.startswith(_LEFT) else ""


def _mirrored(row: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """A window's offsets for the other side; a ball joint's x is forward and y up."""
    mirror = np.array([-1.0, -1.0, 1.0])
    return {
        name: (np.array(row[_other(name)]) * mirror[-len(row[name]) :]).tolist() for name in row
    }


def _usual(name: str) -> float:
    feature = name.rpartition(".")[2]
    return _USUAL.get(feature, _SPIN if feature.startswith("spin") else 1.0)
