"""Levels of colours, 0 to 1, with the gamma of sRGB and without it (IEC 61966-2-1)."""

import numpy as np

from msgs_config.arrays import FloatArray


def without_gamma(levels: FloatArray) -> FloatArray:
    """Levels without it, as the factors and the vertices of glTF have them."""
    levels = np.clip(levels, 0.0, 1.0)
    return np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)


def with_gamma(levels: FloatArray) -> FloatArray:
    """Levels with it, as pictures have them."""
    levels = np.clip(levels, 0.0, 1.0)
    return np.where(levels <= 0.0031308, levels * 12.92, 1.055 * levels ** (1.0 / 2.4) - 0.055)
