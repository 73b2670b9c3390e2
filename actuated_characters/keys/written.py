"""Keys as a file has them: rounded, and with the path that their rotations really take."""

from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.keys.goal import Goal, Keys, Loop, path_of
from actuated_characters.keys.relaxing import relax
from actuated_characters.keys.samples import Samples, moved, spatial_difference
from controller_node.references.files.keyframes import Keyframes
from controller_node.references.keyframes import curve_through
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.geometry import rotations

SHORTEST_GAP = 1e-3  # s, the unit of written times
_DIGITS, _DIGITS_OF_END = 4, 6  # of values and velocities, and of the time of the end, s
_AIM = 0.95  # tolerances, where the path is corrected; the rest is for rounding
_CORRECTIONS, _MAX_ADDED = 4, 30  # of the path before a key is added, and how many are
_SWEPT, _SWEEP_STEP = 10, 5  # keys that are corrected at once, and by how many the next ones begin


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
class WrittenPath:
    """How keys become keyframes, and what their path lacks of the motion."""

    layout: JointLayout
    samples: Samples
    coordinates: FloatArray  # (m, n) of the samples, unrolled, in tolerances
    scale: FloatArray  # (n,) rad or m, the tolerance of each entry
    bounds: tuple[FloatArray, FloatArray]  # (n,) each, rad and m

    def keyframes(self, keys: Keys, loop: Loop | None) -> Keyframes:
        """The keyframes, with values that a file has with a few digits."""
        times, (values, rates) = keys.times, keys.states.swapaxes(0, 1)
        here = np.stack(
            [np.interp(times, self.samples.times, column) for column in self.coordinates.T], axis=1
        )
        way = (values - here) * self.scale
        poses = moved(self.layout, self.samples.at(self.layout, times), way)
        grid = 10.0**_DIGITS
        lower, upper = np.ceil(self.bounds[0] * grid) / grid, np.floor(self.bounds[1] * grid) / grid
        # adding zero leaves no negative zero
        positions = np.clip(np.round(poses.position, _DIGITS), lower, upper) + 0.0
        velocities, entries = rates * self.scale, self.layout.rotation_entries
        back = rotations.conjugate(poses.orientations_xyzw)
        velocities[:, entries] = rotations.rotate(back, velocities[:, entries])
        velocities = np.round(velocities, _DIGITS) + 0.0
        period = None if loop is None else round(loop.period, _DIGITS_OF_END)
        return Keyframes(times, self.layout.configuration(positions), True, period, velocities)

    def left(self, keyframes: Keyframes) -> FloatArray:
        """What the path lacks (m, n) at each sample, in tolerances."""
        path = curve_through(self.layout, keyframes).configurations(self.samples.times)
        difference = spatial_difference(self.layout, path, self.samples.configurations)
        lacking: FloatArray = difference / self.scale
        return lacking

    def corrected(self, goal: Goal, keys: Keys) -> FewestKeys:
        """The keyframes of keys, led back to within the tolerances.

        So far the path was that of plain numbers, which differs a little where rotations turn about
        several axes. What its true path lacks is added to the goal, and the values are fitted anew;
        where this is not enough there is a key more.
        """
        keys = replace(keys, times=_rounded(keys.times, goal.loop))
        best, keys, errors = self._led_back(goal, keys)
        for _ in range(_MAX_ADDED):
            if best.error <= 1.0:
                break
            found, keys, errors = self._led_back(goal, _with_one_more(goal, keys, errors))
            best = min(best, found, key=lambda each: each.error)
        return self._plainer(best, goal)

    def _led_back(self, goal: Goal, keys: Keys) -> tuple[FewestKeys, Keys, FloatArray]:
        """The best of some corrections of the path, none included, and the errors (m,) of it.

        Where rotations between two keys are large, plain numbers tell little of the true path, and
        what is corrected may be worse.
        """
        best: FewestKeys | None = None
        tried, errors = keys, np.empty(0)
        for _ in range(_CORRECTIONS):
            keyframes = self.keyframes(tried, goal.loop)
            left = self.left(keyframes)
            lengths = goal.lengths(left)
            found = self._found(keyframes, lengths)
            if best is None or found.error < best.error:
                best, keys, errors = found, tried, lengths.max(axis=1)
            if best.error <= 1.0:
                break
            path = path_of(goal, tried, self.samples.times)
            true_goal = replace(goal, times=self.samples.times, values=path + left)
            if goal.loop is not None:
                true_goal = true_goal.looped(goal.loop)
            tried = _refitted(true_goal, tried)
        assert best is not None
        return best, keys, errors

    def _plainer(self, found: FewestKeys, goal: Goal) -> FewestKeys:
        """The keys without those velocities of joints that the path can do without."""
        keyframes, most = found.keyframes, max(found.error, 1.0)
        assert keyframes.velocities is not None
        inner = slice(None) if goal.loop is not None else slice(1, -1)
        for row in range(len(keyframes.times))[inner]:
            velocities = keyframes.velocities.copy()
            velocities[row] = np.nan
            errors = goal.lengths(self.left(replace(keyframes, velocities=velocities))).max(axis=0)
            errors = np.repeat(errors, self.layout.vector_lengths)
            for joint in self.layout.joints:
                if errors[joint.entries].max() > most:
                    velocities[row, joint.entries] = keyframes.velocities[row, joint.entries]
            keyframes = replace(keyframes, velocities=velocities)
        return self._found(keyframes, goal.lengths(self.left(keyframes)))

    def _found(self, keyframes: Keyframes, lengths: FloatArray) -> FewestKeys:
        tolerances = self.scale[self.layout.vector_starts]
        return FewestKeys(keyframes, lengths * tolerances, tolerances)


def _rounded(times: FloatArray, loop: Loop | None) -> FloatArray:
    """Times of keys in whole ms; the end of what is no loop stays where it is."""
    rounded = np.round(times / SHORTEST_GAP) * SHORTEST_GAP
    if loop is None:
        rounded[-1] = round(float(times[-1]), _DIGITS_OF_END)
    return rounded


def _refitted(goal: Goal, keys: Keys) -> Keys:
    """The keys with values that are nearer to the goal, wherever the path is far from it."""
    for first in range(0, len(keys.times), _SWEEP_STEP):
        chosen = (first, first + _SWEPT - 1)
        _, keys = relax(goal, keys, chosen, moves=False, aim=_AIM)
    return keys


def _with_one_more(goal: Goal, keys: Keys, errors: FloatArray) -> Keys:
    """The keys with one more, in the middle of the two about the sample that is farthest off."""
    ends = keys.times if goal.loop is None else np.append(keys.times, goal.loop.period)
    worst = goal.times[len(goal.times) // 3 if goal.loop else 0 :][int(errors.argmax())]
    segment = int(np.searchsorted(ends, worst, side="right").clip(1, len(ends) - 1)) - 1
    time = float(np.round(0.5 * (ends[segment] + ends[segment + 1]), 3))
    if min(time - ends[segment], ends[segment + 1] - time) < SHORTEST_GAP:
        return keys
    return keys.inserted(time, goal.states(np.array([time]))[0])
