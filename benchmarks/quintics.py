"""How many keys a clip takes at least, whatever finds them: `python -m benchmarks.quintics`.

Between two keys each hinge and each coordinate of the root is a quintic. So p keys of what is no
loop are no more than p - 1 quintics, and here these need not even meet.
"""

import sys

import numpy as np

from actuated_characters.keys.samples import Tolerances, half_frames
from character_motion.clips.motion_clip import read_motion_clip
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import available_clips

_REFERENCE = 7  # points that fix a quintic and the least error there
_EXCHANGES = 60
_SLACK = 1.0 + 1e-6


def least_error(times: FloatArray, values: FloatArray) -> float:
    """A lower bound of the largest error of any quintic at times (m,), in the unit of values (m,).

    On any seven points the error of the quintic whose errors there are equal with alternating signs
    is such a bound (de la Vallée Poussin 1910); one point after the other is exchanged for that
    with the largest error (Remez 1934).
    """
    count = len(times)
    if count < _REFERENCE:
        return 0.0
    basis = np.polynomial.chebyshev.chebvander(
        2.0 * (times - times[0]) / (times[-1] - times[0]) - 1.0, _REFERENCE - 2
    )
    signs = (-1.0) ** np.arange(_REFERENCE)
    rows = np.round(np.linspace(0, count - 1, _REFERENCE)).astype(int)
    bound = 0.0
    for _ in range(_EXCHANGES):
        found = np.linalg.solve(np.column_stack((basis[rows], signs)), values[rows])
        bound = max(bound, abs(float(found[-1])))
        left = values - basis @ found[:-1]
        worst = int(np.abs(left).argmax())
        if abs(left[worst]) <= bound * _SLACK or worst in rows:
            break
        rows = _exchanged(rows, left, worst)
    return bound


def _exchanged(rows: IntArray, left: FloatArray, worst: int) -> IntArray:
    """The reference (7,) with one point more for one that has the same sign of errors (m,)."""
    place = int(np.searchsorted(rows, worst))
    same = np.sign(left[rows]) == np.sign(left[worst])
    if 0 < place < len(rows):
        rows[place if same[place] else place - 1] = worst
        return rows
    end = 0 if place == 0 else -1
    if same[end]:
        rows[end] = worst
        return rows
    kept = rows[:-1] if place == 0 else rows[1:]
    return np.sort(np.append(kept, worst))


def fewest_quintics(times: FloatArray, columns: FloatArray) -> int:
    """So many quintics, or more, are within 1 of each column (m, n), side by side in time."""
    begin, count = 0, 0
    while begin < len(times):
        end = begin + 1
        while end < len(times) and all(
            least_error(times[begin : end + 1], column[begin : end + 1]) <= _SLACK
            for column in columns.T
        ):
            end += 1
        begin, count = end, count + 1
    return count


def main() -> int:
    """Print a row for each clip of the humanoid, or for those that are named."""
    character = load_character("humanoid")
    layout = character.layout
    tolerances = np.repeat(Tolerances().of_vectors(layout), layout.vector_lengths)
    plain = np.ones(layout.size, dtype=np.bool_)
    plain[layout.rotation_entries] = False
    print("| clip | frames | keys at least |")
    print("| --- | --- | --- |")
    for name in sys.argv[1:] or available_clips(character):
        clip = read_motion_clip(character, name)
        samples = half_frames(layout, clip.times, clip.motion)
        columns = (samples.configurations.position / tolerances)[:, plain]
        least = fewest_quintics(samples.times, columns) + 1
        print(f"| `{name}` | {len(clip.times)} | {least} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
