"""What a policy is told: how the state deviates from the reference, and where the reference leads.

Vectors are in the heading frame of the reference: its z is up, its x the way that the root faces.
"""

import math
from typing import NamedTuple

import numpy as np

from controller_node.planner.compiled.decorator import compiled
from controller_node.planner.compiled.network import Network, evaluate
from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.compiled.rotations import axes, quaternion, to_parent

FRAME_VECTORS = 12  # numbers of a frame that are vectors, without the end effectors
MOST_SCALES = 5.0  # that an entry may be off


class ObservationScales(NamedTuple):
    """By what the entries of an observation are divided, and what is taken off before."""

    deviation: FloatArray  # (f,)
    frame_mean: FloatArray  # (frames, d)
    frame_scale: FloatArray  # (frames, d)
    centre: int  # the place of the centre of mass in features


@compiled
def heading(position: FloatArray, left: FloatArray) -> float:
    """Where the root faces, rad about z from x: at right angles to where its left axis points.

    Args:
        position: MuJoCo's (q,).
        left: The root's axis (3,), in its frame, that points to the left while it stands.
    """
    x, y, _ = to_parent(axes(quaternion(position, 3)), (left[0], left[1], left[2]))
    return math.atan2(-x, y)


@compiled
def write_frame(
    frame: FloatArray, position: FloatArray, joints: FloatArray, features: FloatArray, centre: int
) -> None:
    """Write a reference's state as a policy is told of it (d,).

    Vectors in world axes: the centre of mass, its velocity, the root's x axis and z axis, and the
    end effectors; then the joints' positions.

    Args:
        frame: The result.
        position: MuJoCo's (q,).
        joints: Positions of the joints (n - 6,), message form.
        features: Of the state against itself.
        centre: The place of the centre of mass in features.
    """
    rows = axes(quaternion(position, 3))
    for i in range(3):
        frame[i] = features[centre + i]
        frame[3 + i] = features[centre + 3 + i]
        frame[6 + i] = rows[i][0]
        frame[9 + i] = rows[i][2]
    ends = len(features) - centre - 9
    frame[FRAME_VECTORS : FRAME_VECTORS + ends] = features[centre + 9 :]
    frame[FRAME_VECTORS + ends :] = joints


@compiled
def find_deviation(
    deviation: FloatArray,
    features: FloatArray,
    wanted: FloatArray,
    facing: float,
    centre: int,
) -> None:
    """Write the deviation (f,) of features from those of the reference, in its heading frame."""
    for i in range(len(features)):
        deviation[i] = features[i] - wanted[i]
    _turn_back(deviation[centre:], facing)


@compiled
def observe(
    observation: SingleArray,
    deviation: FloatArray,
    frames: FloatArray,
    facing: float,
    scales: ObservationScales,
) -> None:
    """Write an observation of a deviation (f,), and of frames (frames, d): the first one is now."""
    size, vectors = len(deviation), len(deviation) - scales.centre + 3
    for i in range(size):
        observation[i] = min(max(deviation[i] / scales.deviation[i], -MOST_SCALES), MOST_SCALES)
    for k in range(len(frames)):
        start = size + k * frames.shape[1]
        _write_relative(observation[start:], frames[k], frames[0], facing, vectors)
        for i in range(frames.shape[1]):
            off = observation[start + i] - scales.frame_mean[k, i]
            observation[start + i] = min(
                max(off / scales.frame_scale[k, i], -MOST_SCALES), MOST_SCALES
            )


@compiled
def _write_relative(
    row: SingleArray, frame: FloatArray, now: FloatArray, facing: float, vectors: int
) -> None:
    """Write a frame (d,), the centre of mass against that of now, end effectors against it."""
    for i in range(len(frame)):
        row[i] = frame[i]
    for i in range(2):
        row[i] = frame[i] - now[i]  # the height counts against the ground
    for k in range(FRAME_VECTORS, vectors):
        row[k] = frame[k] - frame[k % 3]
    _turn_back(row[:vectors], facing)


@compiled
def _turn_back(vectors: FloatArray | SingleArray, angle: float) -> None:
    """Turn vectors, one after the other, about z by the negative angle."""
    c, s = math.cos(angle), math.sin(angle)
    for first in range(0, len(vectors), 3):
        x, y = vectors[first], vectors[first + 1]
        vectors[first], vectors[first + 1] = c * x + s * y, c * y - s * x


@compiled
def decide(
    action: FloatArray,
    network: Network,
    value: Network,
    observation: SingleArray,
    unit: FloatArray,
    largest: float,
) -> float:
    """Write the offsets (a,) that a policy answers an observation with; returns what it expects."""
    answer, expected = np.empty(len(action), np.float32), np.empty(1, np.float32)
    evaluate(network, observation, answer)
    evaluate(value, observation, expected)
    for i in range(len(action)):
        action[i] = unit[i] * min(max(answer[i], -largest), largest)
    return float(expected[0])
