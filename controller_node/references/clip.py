"""Captured motion as a reference: interpolated, and continued from its end where it wraps."""

import cmath
from bisect import bisect_right
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from controller_node.references.base import REFERENCES, Motion, ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character
from msgs_config.clips.reading import ClipFrames, read_clip
from msgs_config.geometry import rotations
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter

_BLEND_TIME = 0.15  # s before the wrap, over which the gap to the first frame is closed

_STRAIGHT = 1e-9  # rad a cycle; below it the limit of the geometric series is taken
_CycleMotion: TypeAlias = tuple[complex, complex, complex, FloatArray]


class ClipReference:
    """A clip in time. Between two frames every velocity is constant, so that it agrees exactly
    with the interpolation: linear for coordinates, along the shortest turn for rotations. So the
    acceleration is zero but at the frames themselves, where the velocity jumps.

    A clip that wraps goes on from where, and in the direction in which, it ended; one that does
    not holds its last frame at zero velocity.
    """

    def __init__(self, layout: JointLayout, frames: ClipFrames) -> None:
        self._layout = layout
        self._wraps = frames.wraps
        self._moves = layout.has_floating_base
        self._times = frames.times
        self._frame_times: list[float] = frames.times.tolist()
        self._period = float(frames.times[-1])
        positions, orientations = frames.positions, frames.orientations_xyzw
        self._turn = 0.0  # rad about z a cycle
        if frames.wraps:
            if self._moves:
                self._turn = float(_cycle_turn(orientations[:, 0]))
            positions, orientations = self._closed(frames)
        self._positions, self._orientations = positions, orientations
        self._velocities = self._segment_velocities()
        self._no_acceleration = np.zeros(layout.size)
        self._last = self._at_end()
        self._cycle_motions: dict[int, _CycleMotion] = {}  # this cycle's and the next one's

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the clip's first frame."""
        return self.samples((time,))[0]

    def samples(self, times: Sequence[float]) -> list[ReferenceState]:
        """The desired states at rising times in s."""
        moving = times if self._wraps else [time for time in times if time < self._period]
        states = self._moving(moving) if moving else []
        return states + [self._last] * (len(times) - len(states))

    def _moving(self, times: Sequence[float]) -> list[ReferenceState]:
        """The states at rising times, before the end of a clip that does not wrap."""
        cycles = [int(time // self._period) if self._wraps else 0 for time in times]
        frames, since_frames = self._frames_at(times, cycles)
        velocities = self._velocities[frames]
        positions = self._positions[frames] + since_frames * velocities
        turned = (since_frames * velocities)[:, self._layout.rotation_entries]
        orientations = rotations.multiply(self._orientations[frames], rotations.exp(turned))
        if self._moves:
            first = bisect_right(cycles, 0)
            while first < len(cycles):
                rows = slice(first, bisect_right(cycles, cycles[first]))
                self._continue_root(
                    cycles[first], positions[rows], orientations[rows], velocities[rows]
                )
                first = rows.stop
        positions[:, self._layout.rotation_entries] = rotations.log(orientations)
        return [
            ReferenceState(GeneralizedPosition(position, turns), velocity, self._no_acceleration)
            for position, turns, velocity in zip(positions, orientations, velocities, strict=True)
        ]

    def _frames_at(
        self, times: Sequence[float], cycles: Sequence[int]
    ) -> tuple[list[int], FloatArray]:
        """The last frame (m) before each time, and the time since then (m, 1) in s."""
        frames, since_frames = [], []
        last = len(self._frame_times) - 1
        for time, cycle in zip(times, cycles, strict=True):
            time_in_cycle = time - cycle * self._period
            frame = min(bisect_right(self._frame_times, time_in_cycle), last) - 1
            frames.append(frame)
            since_frames.append(time_in_cycle - self._frame_times[frame])
        return frames, np.array(since_frames)[:, np.newaxis]

    def _at_end(self) -> ReferenceState:
        """The last frame, at zero velocity."""
        position = self._positions[-1].copy()
        position[self._layout.rotation_entries] = rotations.log(self._orientations[-1])
        configuration = GeneralizedPosition(position, self._orientations[-1])
        return ReferenceState(configuration, self._no_acceleration, self._no_acceleration)

    def _closed(self, frames: ClipFrames) -> tuple[FloatArray, FloatArray]:
        """The frames with the last ones led towards the first one of the next cycle."""
        progress = np.clip(
            (frames.times - self._period) / min(_BLEND_TIME, self._period) + 1.0, 0.0, 1.0
        )
        weight = (progress * progress * (3.0 - 2.0 * progress))[:, np.newaxis]
        positions, orientations = frames.positions, frames.orientations_xyzw
        gap = positions[0] - positions[-1]
        goal = orientations[0]
        if self._moves:
            gap[:2] = 0.0  # on the ground it goes on from where it is
            goal = goal.copy()
            goal[0] = rotations.multiply(rotations.about_z(self._turn), orientations[0, 0])
        turn = rotations.log(rotations.multiply(rotations.conjugate(orientations[-1]), goal))
        correction = rotations.exp(weight[:, :, np.newaxis] * turn)
        within = np.clip(positions + weight * gap, *frames.bounds)
        return within, rotations.multiply(orientations, correction)

    def _segment_velocities(self) -> FloatArray:
        """Velocity (f - 1, n) between each frame and the next; a rotation's in the child frame."""
        durations = np.diff(self._times)[:, np.newaxis]
        velocities = np.diff(self._positions, axis=0) / durations
        turns = rotations.multiply(
            rotations.conjugate(self._orientations[:-1]), self._orientations[1:]
        )
        entries = self._layout.rotation_entries
        velocities[:, entries] = rotations.log(turns) / durations[:, :, np.newaxis]
        return velocities

    def _continue_root(
        self, cycle: int, positions: FloatArray, orientations: FloatArray, velocities: FloatArray
    ) -> None:
        """Carry roots on from the end of the cycle before: displacement and yaw composed.

        Of positions (m, n), orientations (m, k, 4) and velocities (m, n), in place. On the ground
        plane, as complex numbers, one cycle maps `x` to `start + d + z (x - start)` with
        `z = exp(i turn)`; n of them shift by `d (1 + z + ... + z^(n-1))`. The products are written
        out: numpy's own of complex numbers depend on the processor.
        """
        motions = self._cycle_motions
        if cycle not in motions:
            motions.pop(min(motions, default=cycle) if len(motions) > 1 else cycle, None)
            motions[cycle] = self._motion_of(cycle)
        start, shift, turn, turn_xyzw = motions[cycle]
        x, y = positions[:, 0] - start.real, positions[:, 1] - start.imag
        begin = start + shift
        positions[:, 0] = begin.real + (turn.real * x - turn.imag * y)
        positions[:, 1] = begin.imag + (turn.real * y + turn.imag * x)
        x, y = velocities[:, 0].copy(), velocities[:, 1].copy()
        velocities[:, 0] = turn.real * x - turn.imag * y
        velocities[:, 1] = turn.real * y + turn.imag * x
        orientations[:, 0] = rotations.multiply(turn_xyzw, orientations[:, 0])

    def _motion_of(self, cycle: int) -> _CycleMotion:
        """Start, shift, turn, and the turn's quaternion, that `cycle` cycles add up to."""
        start = complex(*self._positions[0, :2])
        displacement = complex(*self._positions[-1, :2]) - start
        one_turn, turn = cmath.exp(1j * self._turn), cmath.exp(1j * self._turn * cycle)
        straight = abs(self._turn) < _STRAIGHT
        shift = displacement * (cycle if straight else (1.0 - turn) / (1.0 - one_turn))
        return start, shift, turn, rotations.about_z(self._turn * cycle)


def _cycle_turn(root_xyzw: FloatArray) -> FloatArray:
    """Turn in rad about z from the first frame to the last."""
    return rotations.yaw(rotations.multiply(root_xyzw[-1], rotations.conjugate(root_xyzw[0])))


class ClipSettings(Settings):
    """The clip that is tracked."""

    clip: str = parameter(
        "walk", "name of a clip of the character, or path of a .txt or .json file"
    )


@REFERENCES.register("clip", ClipSettings)
def _clip(character: Character, values: Values) -> Motion:
    frames = read_clip(character, ClipSettings.of(values).clip)
    names = ", ".join(frames.clamped)
    warnings = (f"kept within joint limits: {names}",) if names else ()
    return Motion(ClipReference(character.layout, frames), warnings)
