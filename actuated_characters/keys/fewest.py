"""The fewest keys whose smooth path stays within tolerances of a motion."""

import numpy as np

from actuated_characters.keys.goal import Goal, Keys, Loop, path_of
from actuated_characters.keys.leading_back import all_led_back, rounded
from actuated_characters.keys.samples import Samples, Tolerances, unrolled
from actuated_characters.keys.thinning import Progress, Thinning
from actuated_characters.keys.written import SHORTEST_GAP, FewestKeys, WrittenPath
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout

_DENSE = 30.0  # keys a second, with which it begins


def fewest_keys(
    layout: JointLayout,
    samples: Samples,
    tolerances: Tolerances,
    *,
    bounds: tuple[FloatArray, FloatArray],
    loops: bool = False,
    progress: Progress = lambda share: None,
) -> FewestKeys:
    """Find few keys whose smooth path is within tolerances of a motion at each sample.

    Keys begin at each frame, or at some thirty a second, and where the path misses a sample. The
    least needed one is taken away while values and rates, and then times, of its neighbours make up
    for it: so poses are near the motion's and not quite on it. Times are multiples of 0.1 ms, two
    that moved at least a frame apart, values of 0.1 mrad and 0.1 mm.

    The same motion gives the same keys.

    Args:
        layout: Of the character.
        samples: The motion at its frames and halfway between them.
        tolerances: Of the path, at each sample.
        bounds: Lower and upper bound (n,) of keys, rad and m, infinite where there is none.
        loops: Whether the last frame is the first one again, and the path a loop.
        progress: Called with the share that is done, 0 to 1.
    """
    scale = _of_entries(layout, tolerances)
    coordinates = _coordinates(layout, samples, scale)
    goal = _goal(layout, samples, scale, bounds, loops=loops)
    keys = _keys_of_frames(goal, samples.times)
    written = WrittenPath(layout, samples, coordinates, scale, bounds)
    led = all_led_back(written, goal, keys)
    thinning = Thinning(written, led.goal, led.keys, progress)
    thinning.thin()
    led = all_led_back(written, thinning.goal, rounded(thinning.goal, thinning.keys))
    return written.plainest(led)


def _of_entries(layout: JointLayout, tolerances: Tolerances) -> FloatArray:
    """The tolerance (n,) of each entry's vector."""
    return np.repeat(tolerances.of_vectors(layout), layout.vector_lengths)


def _coordinates(layout: JointLayout, samples: Samples, scale: FloatArray) -> FloatArray:
    """Coordinates (m, n) in tolerances: all but rotations are the positions themselves."""
    coordinates = samples.configurations.position.copy()
    entries = layout.rotation_entries
    coordinates[:, entries] = unrolled(layout, samples)[:, entries]
    scaled: FloatArray = coordinates / scale
    return scaled


def _goal(
    layout: JointLayout,
    samples: Samples,
    scale: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    *,
    loops: bool,
) -> Goal:
    goal = Goal(
        samples.times,
        _coordinates(layout, samples, scale),
        layout.vector_starts,
        (bounds[0] / scale, bounds[1] / scale),
        max(2.0 * float(np.median(np.diff(samples.times))), SHORTEST_GAP),
    )
    if not loops:
        return goal
    return goal.looped(Loop(float(samples.times[-1]), goal.values[-1] - goal.values[0]))


def _keys_of_frames(goal: Goal, times: FloatArray) -> Keys:
    """A key at each frame of samples (m,), or some a second, and more where the path needs it."""
    stride = 2 * max(1, round(1.0 / (_DENSE * goal.spacing)))
    is_key, states = np.arange(len(times)) % stride == 0, goal.states(times)
    is_key[-1] = True
    while True:
        rows = np.flatnonzero(is_key[:-1] if goal.loop else is_key)
        keys = Keys(times[rows], states[rows])
        missed = goal.lengths(path_of(goal, keys, times) - states[:, 0]).max(axis=1) > 1.0
        if not (missed & ~is_key).any():
            return keys
        is_key |= missed
