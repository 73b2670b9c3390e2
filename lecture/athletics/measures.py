"""What a recording shows of an athlete: its course, the feet that stand, a flight, a fall."""

from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from controller_node.references.steering.reference import SteeredReference
from lecture.framework.study import RunSpec
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.geometry import rotations

FEET = ("right_ankle", "left_ankle")
_WINDOW = 0.5  # s, over which speed and heading are averaged: more than a step


@dataclass(frozen=True)
class CourseSeries:
    """A course over the ground at each state, (t + 1,)."""

    speed: FloatArray  # m/s, ahead
    heading: FloatArray  # rad, of the way that the root faces


def commanded(case: RunSpec) -> CourseSeries:
    """The course that a case is told to take."""
    plan, _ = case.plan()
    reference = plan.reference
    assert isinstance(reference, SteeredReference)
    courses = [reference.course(tick) for tick in range(plan.ticks + 1)]
    return CourseSeries(
        np.array([course.forward for course in courses]),
        np.array([course.heading for course in courses]),
    )


def taken(recording: Recording) -> CourseSeries:
    """The course that a humanoid takes: means over half a second, of the root."""
    facing = rotations.rotate(rotations.exp(recording.position[:, 3:6]), np.array((1.0, 0.0, 0.0)))
    heading = np.unwrap(np.arctan2(facing[:, 1], facing[:, 0]))
    x, y = recording.velocity[:, 0], recording.velocity[:, 1]
    speed = np.cos(heading) * x + np.sin(heading) * y
    rate = (len(recording.times) - 1) / float(recording.times[-1])
    return CourseSeries(_smooth(speed, rate), _smooth(heading, rate))


def _smooth(values: FloatArray, rate: float) -> FloatArray:
    width = round(_WINDOW * rate)
    total = np.convolve(values, np.ones(width), mode="same")
    smooth: FloatArray = total / np.convolve(np.ones(len(values)), np.ones(width), mode="same")
    return smooth


def loaded(recording: Recording) -> BoolArray:
    """Which foot touches the ground in each tick: (t, 2), right and left."""
    by_foot = [
        [wrenches is not None and foot in wrenches.links for foot in FEET]
        for wrenches in recording.contacts
    ]
    return np.array(by_foot, dtype=np.bool_)


def longest_flight(recording: Recording) -> tuple[float, float]:
    """Beginning and length of the longest time without contact of a foot, s; after the first tick.

    A character that is put down touches nothing in its first tick.
    """
    airborne: BoolArray = loaded(recording).sum(axis=1) == 0
    airborne[0] = False
    edges = np.flatnonzero(np.diff(np.r_[0, airborne, 0]))
    times = recording.times
    spans = [(float(times[a]), float(times[b] - times[a])) for a, b in edges.reshape(-1, 2)]
    return max(spans, key=lambda span: span[1], default=(0.0, 0.0))
