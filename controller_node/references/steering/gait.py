"""Walking and running at any speed, blended from captured cycles.

A cycle is split into a point that moves evenly over the ground and the pose above it. Poses of
equal phase are blended, and the lengths of the strides with them; the frequency follows from the
speed. Source: Park, Shin and Shin 2002, "On-line Locomotion Generation Based on Motion Blending";
a standing pose is the slowest of the cycles here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from controller_node.references.base import Reference
from controller_node.references.steering.course import Footprint
from controller_node.references.steering.footsteps import FootCycle, find_foot_cycle
from controller_node.references.steering.legs import Legs
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character
from msgs_config.compiled.rotations import blend_turns
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import fixed_order, rotations

_SPEEDS = 64  # whose feet are remembered; it asks for some again and again
_ROWS = 96  # steps of phase in a cycle
_LEAST_SPEED = 0.05  # m/s
_MOST_TURN = 0.5  # rad a cycle, at most; the turn is taken out


@dataclass(frozen=True)
class GaitCycle:
    """One cycle along x: poses at equal steps of its phase, above a point that moves evenly.

    Behind the body's coordinates are those of its f feet: places, and orientations.
    """

    stride: float  # m a cycle
    period: float  # s
    positions: FloatArray  # (r + 1, n + 3f), but for rotations; the last is the first once more
    orientations_xyzw: FloatArray  # (r + 1, k + f, 4)
    foot_cycles: tuple[FootCycle, ...]  # (f,), or none if a foot stands otherwise than once

    @property
    def speed(self) -> float:
        """Mean speed in m/s."""
        return self.stride / self.period

    def at(self, phase: float) -> GeneralizedPosition:
        """Body and feet at a phase from 0 to 1; only `orientations_xyzw` has rotations."""
        rows = len(self.positions) - 1
        row = min(int(phase * rows), rows - 1)
        a, b = (
            GeneralizedPosition(self.positions[each], self.orientations_xyzw[each])
            for each in (row, row + 1)
        )
        return _between(a, b, phase * rows - row)


def cycle_of(name: str, reference: Reference, period: float, character: Character) -> GaitCycle:
    """The cycle of a reference that repeats its pose every `period` s, turned to go along x.

    Raises:
        ConfigurationError: it goes nowhere, or not straight ahead; names it.
    """
    states = [reference.sample(period * row / _ROWS).configuration for row in range(_ROWS + 1)]
    positions = np.array([state.position for state in states])
    turns = np.array([state.orientations_xyzw for state in states])
    x, y = (positions[-1, :2] - positions[0, :2]).tolist()
    stride = math.sqrt(x * x + y * y)
    bend = float(rotations.yaw(rotations.multiply(turns[-1, 0], rotations.conjugate(turns[0, 0]))))
    if stride / period < _LEAST_SPEED or abs(bend) > _MOST_TURN:
        raise ConfigurationError(
            f"clip '{name}' moves by {stride:.3g} m and turns by {bend:.3g} rad a cycle; to steer, "
            "it must go straight ahead"
        )
    heading = math.atan2(y, x)
    phases = np.arange(_ROWS + 1) / _ROWS
    positions[:, :3] = rotations.rotate(rotations.about_z(-heading), positions[:, :3])
    positions[:, 0] -= stride * phases
    positions[:, :2] -= fixed_order.mean(positions[:-1, :2], axis=0)
    straight = [rotations.about_z(-heading - bend * (phase - 0.5)) for phase in phases.tolist()]
    turns[:, 0] = rotations.multiply(np.array(straight), turns[:, 0])
    n, k = positions.shape[1], turns.shape[1]
    positions, turns = _with_feet(character, positions, turns)
    at_rest = Legs(character).feet(rest_pose(character)).orientations_xyzw
    places = positions[:, n:].reshape(len(positions), -1, 3)
    found = [
        find_foot_cycle(places[:, foot], turns[:, k + foot], stride, upright)
        for foot, upright in enumerate(at_rest)
    ]
    once = tuple(each for each in found if each is not None)
    return GaitCycle(stride, period, positions, turns, once if len(once) == len(found) else ())


def standing_cycle(character: Character, walk: GaitCycle) -> GaitCycle:
    """The pose at rest as a cycle that goes nowhere; feet stand in it when they do in a walk."""
    pose = rest_pose(character)
    positions, turns = _with_feet(
        character, np.array([pose.position] * 2), np.array([pose.orientations_xyzw] * 2)
    )
    places = positions[0, len(pose.position) :].reshape(-1, 3).tolist()
    cycles = [
        replace(cycle, middle=Footprint(complex(x, y), 0.0))
        for cycle, (x, y, _) in zip(walk.foot_cycles, places, strict=False)
    ]
    return GaitCycle(0.0, walk.period, positions, turns, tuple(cycles))


def still_gait(character: Character) -> "Gait":
    """The pose at rest at any speed: what it does to go on is not said."""
    pose = rest_pose(character)
    positions = np.array([pose.position] * 2)
    still = GaitCycle(0.0, 1.0, positions, np.array([pose.orientations_xyzw] * 2), ())
    return Gait(character.layout, [still, replace(still, stride=1.0)])


def rest_pose(character: Character) -> GeneralizedPosition:
    """How a character rests, above the origin."""
    position: FloatArray = np.array(character.rest_position)
    position[:2] = 0.0
    return character.layout.configuration(position)


def _with_feet(
    character: Character, positions: FloatArray, turns: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Coordinates of bodies (r, n) and (r, k, 4), with those of their feet behind."""
    legs = Legs(character)
    feet = [legs.feet(GeneralizedPosition(*pose)) for pose in zip(positions, turns, strict=True)]
    places = np.array([each.position for each in feet])
    facing = np.array([each.orientations_xyzw for each in feet])
    return np.concatenate((positions, places), axis=1), np.concatenate((turns, facing), axis=1)


class Gait:
    """Cycles of rising speed, as one motion of any speed up to the fastest."""

    def __init__(self, layout: JointLayout, cycles: Sequence[GaitCycle]) -> None:
        """Blend two cycles or more.

        Raises:
            ConfigurationError: one is not faster than the one before.
        """
        self._cycles, self._size = cycles, (layout.size, len(layout.rotation_entries))
        self._speeds = [cycle.speed for cycle in cycles]
        self._foot_cycles: dict[float, tuple[FootCycle, ...]] = {}  # of speeds of late
        for slow, fast in zip(self._speeds, self._speeds[1:], strict=False):
            if fast <= slow:
                raise ConfigurationError(
                    f"a cycle of {fast:.3g} m/s follows one of {slow:.3g} m/s; to steer, the clip "
                    "to run must be faster than the one to walk"
                )

    @property
    def speeds(self) -> tuple[float, ...]:
        """Mean speeds of the cycles, m/s."""
        return tuple(self._speeds)

    def _around(self, speed: float) -> tuple[GaitCycle, GaitCycle, float]:
        """The cycles around a speed, and the share of the faster one."""
        row = 1
        while row < len(self._speeds) - 1 and speed >= self._speeds[row]:
            row += 1
        slow, fast = self._cycles[row - 1], self._cycles[row]
        share = (speed - slow.speed) / (fast.speed - slow.speed)
        return slow, fast, min(max(share, 0.0), 1.0)

    def stride(self, speed: float) -> float:
        """Length of a cycle in m at a speed in m/s."""
        slow, fast, share = self._around(abs(speed))
        return slow.stride + share * (fast.stride - slow.stride)

    def frequency(self, speed: float) -> float:
        """Cycles a second at a speed in m/s; negative backwards, and zero for one that stands."""
        stride = self.stride(speed)
        return speed / stride if stride > 0.0 else 0.0

    def at(self, speed: float, phase: float) -> tuple[GeneralizedPosition, GeneralizedPosition]:
        """Body and feet at a speed in m/s and a phase from 0 to 1, above the origin, along x.

        Only `orientations_xyzw` has rotations. Feet have places (3f,) and orientations (f, 4).
        """
        slow, fast, share = self._around(abs(speed))
        both = slow.at(phase)
        if share != 0.0:
            both = _between(both, fast.at(phase), share)
        n, k = self._size
        return (
            GeneralizedPosition(both.position[:n], both.orientations_xyzw[:k]),
            GeneralizedPosition(both.position[n:], both.orientations_xyzw[k:]),
        )

    def foot_cycles(self, speed: float) -> tuple[FootCycle, ...]:
        """When each foot stands at a speed in m/s; none where one does otherwise than once."""
        found = self._foot_cycles.get(speed)
        if found is None:
            if len(self._foot_cycles) > _SPEEDS:
                self._foot_cycles.clear()
            slow, fast, share = self._around(abs(speed))
            pairs = zip(slow.foot_cycles, fast.foot_cycles, strict=False)
            found = tuple(a.towards(b, share) for a, b in pairs)
            self._foot_cycles[speed] = found
        return found


def _between(a: GeneralizedPosition, b: GeneralizedPosition, share: float) -> GeneralizedPosition:
    """Linear between coordinates, along the shorter turn between rotations."""
    turns = np.empty_like(a.orientations_xyzw)
    blend_turns(a.orientations_xyzw, b.orientations_xyzw, share, turns)
    return GeneralizedPosition(a.position + share * (b.position - a.position), turns)
