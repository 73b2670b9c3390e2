"""Keys as a file has them: rounded, and with the path that their rotations really take."""

from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.keys.goal import Goal, Keys, Loop, path_of
from actuated_characters.keys.samples import Samples, moved, spatial_difference
from controller_node.references.files.keyframes import Keyframes
from controller_node.references.keyframes import curve_through
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.geometry import rotations

SHORTEST_GAP = 1e-3  # s, the unit of written times
_DIGITS, DIGITS_OF_END = 4, 6  # of values and velocities, and of the time of the end, s


@dataclass(frozen=True)
class FewestKeys:
    """Keys, and how far their path is from the motion."""

    keyframes: Keyframes
    deviations: FloatArray  # (m, b) at each sample, of each physical vector, rad or m
    tolerances: FloatArray  # (b,) rad or m

    @property
    def error(self) -> float:
        """The largest deviation, in tolerances."""
        return float((self.deviations / self.tolerances).max())


@dataclass(frozen=True)
class Led:
    """Keys, and the goal for which their plain path lacks as much as the written one does."""

    keys: Keys
    goal: Goal
    errors: FloatArray  # (r,) the largest one of each sample that was looked at, in tolerances

    @property
    def error(self) -> float:
        """The largest error, in tolerances."""
        return float(self.errors.max())


@dataclass(frozen=True)
class WrittenPath:
    """How keys become keyframes, and what their path lacks of the motion."""

    layout: JointLayout
    samples: Samples
    coordinates: FloatArray  # (m, n) of the samples, unrolled, in tolerances
    scale: FloatArray  # (n,) rad or m, the tolerance of each entry
    bounds: tuple[FloatArray, FloatArray]  # (n,) each, rad and m

    def keyframes(self, keys: Keys, loop: Loop | None) -> Keyframes:
        """The keyframes, with values that a file has with a few digits."""
        times, (values, *rates) = keys.times, keys.states.swapaxes(0, 1)
        here = np.stack(
            [np.interp(times, self.samples.times, column) for column in self.coordinates.T], axis=1
        )
        way = (values - here) * self.scale
        poses = moved(self.layout, self.samples.at(self.layout, times), way)
        grid = 10.0**_DIGITS
        lower, upper = np.ceil(self.bounds[0] * grid) / grid, np.floor(self.bounds[1] * grid) / grid
        # adding zero leaves no negative zero
        positions = np.clip(np.round(poses.position, _DIGITS), lower, upper) + 0.0
        own = [each * self.scale for each in rates]
        entries, back = self.layout.rotation_entries, rotations.conjugate(poses.orientations_xyzw)
        for each in own:
            each[:, entries] = rotations.rotate(back, each[:, entries])
        period = None if loop is None else round(loop.period, DIGITS_OF_END)
        configurations = self.layout.configuration(positions)
        own = [np.round(each, _DIGITS) + 0.0 for each in own]
        return Keyframes(times, configurations, True, period, *own)

    def led(self, goal: Goal, keys: Keys, part: tuple[int, int] | None = None) -> Led:
        """What the path of keys as they are written lacks, where the keys of a part count.

        The path of keys is that of plain numbers, which differs from the written one where
        rotations turn about several axes.
        """
        rows, some = slice(None), keys
        if part is not None and goal.loop is None:
            some = keys[max(part[0] - 1, 0) : part[1] + 2]
            begin, end = np.searchsorted(self.samples.times, [some.times[0], some.times[-1]])
            rows = slice(int(begin), int(end) + 1)
        left = self.left(self.keyframes(some, goal.loop), rows)
        values = goal.values.copy()
        if goal.loop is not None:
            values = values[: len(self.samples.times)]
        values[rows] = path_of(goal, some, self.samples.times[rows]) + left
        true_goal = replace(goal, times=self.samples.times, values=values)
        if goal.loop is not None:
            true_goal = true_goal.looped(goal.loop)
        return Led(keys, true_goal, goal.lengths(left).max(axis=1))

    def left(self, keyframes: Keyframes, rows: slice = slice(None)) -> FloatArray:
        """What the path lacks (r, n) at samples, in tolerances."""
        samples = self.samples[rows]
        path = curve_through(self.layout, keyframes).configurations(samples.times)
        difference = spatial_difference(self.layout, path, samples.configurations)
        lacking: FloatArray = difference / self.scale
        return lacking

    def plainest(self, led: Led) -> FewestKeys:
        """The keyframes of keys, without those rates of joints that the path can do without."""
        goal, keyframes, most = (
            led.goal,
            self.keyframes(led.keys, led.goal.loop),
            max(led.error, 1.0),
        )
        for row in range(len(keyframes.times)):
            for both in (True, False):
                keyframes = self._without(goal, keyframes, row, most, both=both)
        lengths, tolerances = goal.lengths(self.left(keyframes)), self.scale[goal.starts]
        return FewestKeys(keyframes, lengths * tolerances, tolerances)

    def _without(
        self, goal: Goal, keyframes: Keyframes, row: int, most: float, *, both: bool
    ) -> Keyframes:
        """Keyframes without accelerations, or both rates, of the joints that do without in one."""
        velocities, accelerations = keyframes.velocities, keyframes.accelerations
        assert velocities is not None and accelerations is not None
        is_left_out = np.zeros(velocities.shape, dtype=np.bool_)
        is_left_out[row] = True

        def tried() -> Keyframes:
            return replace(
                keyframes,
                velocities=np.where(is_left_out & both, np.nan, velocities),
                accelerations=np.where(is_left_out, np.nan, accelerations),
            )

        errors = goal.lengths(self.left(tried())).max(axis=0)
        is_needed = np.repeat(errors, self.layout.vector_lengths) > most
        for joint in self.layout.joints:
            if is_needed[joint.entries].any():
                is_left_out[row, joint.entries] = False
        return tried()
