"""The ground as the feet feel it."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order

_SAME = 0.005  # m: what differs by less is as high


@dataclass(frozen=True)
class FeltGround:
    """A plane below each of f feet: where its sole stands, or where the others' stand meanwhile."""

    heights: tuple[float, ...] = ()  # (f,) m, world; none before the first look

    @property
    def level(self) -> float:
        """How high it is in the mean, m."""
        return float(fixed_order.mean(np.array(self.heights))) if self.heights else 0.0

    @property
    def planes(self) -> FloatArray:
        """How high each foot's plane (f,) is over the level, m."""
        return np.array(self.heights) - self.level

    def after(self, soles: FloatArray) -> "FeltGround":
        """What is felt by soles (f,) in m; NaN are those that do not stand."""
        planes, stand = np.array(self.heights or (0.0,) * len(soles)), ~np.isnan(soles)
        if stand.any():
            planes = np.where(stand & (np.abs(soles - planes) >= _SAME), soles, planes)
            planes[~stand] = fixed_order.mean(planes[stand])
        return FeltGround(tuple(planes.tolist()))
