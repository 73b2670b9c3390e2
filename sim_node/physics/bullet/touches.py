"""What touches a body's links, and the net wrenches of that."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray


class Touch(NamedTuple):
    """One contact as one of its two links feels it; world axes."""

    link: int  # the engine's number of the link
    force: Sequence[float]  # (3,) N
    point: Sequence[float]  # (3,) m, where the engine let the force act


TouchedLinks: TypeAlias = Mapping[int, Sequence[Touch]]
"""By body number, what touches its links."""


def net_wrenches(
    touches: Sequence[Touch], rows: Mapping[int, int], centres: Sequence[Sequence[float]]
) -> tuple[FloatArray, BoolArray]:
    """Net contact wrench (links, 6) of what touches, world axes; and which links do (links,).

    It is the force in N, and the torque in N m about `centres` (links, 3), the links' centres
    of mass when the engine's step began. A contact between two links of the body counts on
    both, in opposite directions. `rows` are those of the engine's numbers of links.
    """
    sums: dict[int, list[float]] = {}  # by row; plain numbers are faster for few contacts
    for number, (fx, fy, fz), (px, py, pz) in touches:
        row = rows[number]
        cx, cy, cz = centres[row]
        x, y, z = px - cx, py - cy, pz - cz
        total = sums.setdefault(row, [0.0] * 6)
        total[0] += fx
        total[1] += fy
        total[2] += fz
        total[3] += y * fz - z * fy
        total[4] += z * fx - x * fz
        total[5] += x * fy - y * fx
    wrenches = np.zeros((len(rows), 6))
    touching = np.zeros(len(rows), dtype=np.bool_)
    for row, total in sums.items():
        wrenches[row], touching[row] = total, True
    return wrenches, touching
