"""How a term of a trainer differs from ours: pure functions of both, over the rows of a trace."""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.geometry import rotations

CLOSE = 2e-4  # of an entry, and of its size: traces have single precision, files three digits
_MOST_SHIFT = 20  # rows
_LEAST = 1e-3  # of an entry: what is smaller says nothing of a factor or an order


def agrees(theirs: FloatArray, ours: FloatArray) -> bool:
    """Whether entries are the same but for rounding."""
    return bool((np.abs(theirs - ours) <= CLOSE * (1.0 + np.abs(ours))).all())


def differing(theirs: FloatArray, ours: FloatArray) -> BoolArray:
    """Where entries of one shape are not the same but for rounding."""
    found: BoolArray = np.abs(theirs - ours) > CLOSE * (1.0 + np.abs(ours))
    return found


def reason(
    theirs: FloatArray,  # (t, s)
    ours: FloatArray,  # (t, s)
    labels: Sequence[str],  # of the s entries
    turns: FloatArray,  # (t, 4) of the base in the world, xyzw
) -> str:
    """What explains all rows of a term, in words; empty if nothing that is known does."""
    if not theirs.any():
        return "the trace has zeros"
    if agrees(theirs, -ours):
        return "the sign"
    if factor := _factor(theirs, ours):
        return f"the scale: the trace has {factor:.4g} times as much"
    if order := _order(theirs, ours):
        return _say_order(order, labels)
    if signs := _signs(theirs, ours):
        return f"the sign of {', '.join(labels[row] for row in signs)}"
    if len(labels) == 3 and agrees(theirs, rotations.rotate(turns, ours)):
        return "the frame: the trace has it in the world's axes"
    if len(labels) == 3 and agrees(theirs, rotations.rotate(rotations.conjugate(turns), ours)):
        return "the frame: the trace has it turned into the base once more"
    if shift := _shift(theirs, ours):
        count, when = abs(shift), "before" if shift > 0 else "later"
        return f"the time: the trace has what is {count} decision{'s' * (count > 1)} {when}"
    if len(theirs) > 1 and agrees(theirs - theirs[0], ours - ours[0]):
        return "an offset, the same in all rows, as of another default pose"
    return ""


def _factor(theirs: FloatArray, ours: FloatArray) -> float:
    """The number that all entries are to be multiplied by; 0 if there is none."""
    size = float(np.square(ours).sum())
    if size < _LEAST**2:
        return 0.0
    factor = float((theirs * ours).sum()) / size
    return factor if agrees(theirs, factor * ours) else 0.0


def _shift(theirs: FloatArray, ours: FloatArray) -> int:
    """By how many rows theirs come after ours, negative: before; 0 if that explains nothing."""
    for shift in range(1, min(len(theirs) - 1, _MOST_SHIFT)):
        if agrees(theirs[shift:], ours[:-shift]):
            return shift
        if agrees(theirs[:-shift], ours[shift:]):
            return -shift
    return 0


def _order(theirs: FloatArray, ours: FloatArray) -> list[int]:
    """Which of our columns each of theirs is; empty if they are not ours in another order."""
    left, order = list(range(ours.shape[1])), list[int]()
    for column in theirs.T:
        found = next((row for row in left if agrees(column, ours[:, row])), None)
        if found is None:
            return []
        left.remove(found)
        order.append(found)
    return order


def _say_order(order: list[int], labels: Sequence[str]) -> str:
    if sorted(labels) == sorted("wxyz"):
        theirs = "".join(labels[row] for row in order)
        return f"the order of the quaternion: the trace has {theirs}, here it is {''.join(labels)}"
    moved = [number for number, row in enumerate(order) if row != number]
    first = moved[0] if moved else 0
    return (
        f"the order: the trace has '{labels[order[first]]}' where '{labels[first]}' is here "
        f"({len(moved)} of {len(labels)} are elsewhere)"
    )


def _signs(theirs: FloatArray, ours: FloatArray) -> list[int]:
    """The columns whose sign alone is another one; empty if that does not explain all."""
    turned = []
    for row in range(ours.shape[1]):
        if agrees(theirs[:, row], ours[:, row]):
            continue
        if not agrees(theirs[:, row], -ours[:, row]):
            return []
        turned.append(row)
    return turned
