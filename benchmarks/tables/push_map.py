"""The impulse that half of the walks bear, by direction, as a picture."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from benchmarks.tables.case import Case, Fact
from msgs_config.arrays import BoolArray, FloatArray

STEPS = 30  # steps of Newton's method
RIDGE = 0.01  # without it few walks leave the fit without a minimum


def draw(results: Sequence[tuple[Case, Mapping[str, Fact]]], file: Path) -> None:
    """Draw walks that were pushed once for 0.2 s, and whether each stayed upright."""
    forces = [case.pushes[0].removeprefix("root:").split(",")[:2] for case, _ in results]
    pushes = 0.2 * np.array(forces, dtype=float)  # N s, forwards and to the left
    is_upright = np.array([bool(facts["upright"]) for _, facts in results])
    sizes, sides = np.hypot(*pushes.T), np.arctan2(pushes[:, 1], pushes[:, 0])
    figure = Figure(figsize=(6.0, 6.0), layout="constrained")
    axes = figure.add_subplot(projection="polar")
    assert isinstance(axes, PolarAxes)
    axes.scatter(sides[is_upright], sizes[is_upright], color="tab:green", label="on its feet")
    axes.scatter(sides[~is_upright], sizes[~is_upright], color="tab:red", marker="x", label="fell")
    around = np.linspace(-math.pi, math.pi, 181)
    half = half_borne(sides, sizes, is_upright, around)
    half[half > sizes.max()] = math.nan  # nothing was tried there
    axes.plot(around, half, "k-", label="half of them")
    axes.set_theta_zero_location("N")
    axes.set_title("pushes of 0.2 s on a walk, N s; forwards is up")
    figure.legend(loc="outside lower center", ncols=3)
    figure.savefig(file, dpi=120)


def half_borne(
    sides: FloatArray, sizes: FloatArray, borne: BoolArray, around: FloatArray
) -> FloatArray:
    """The impulses (a,) in N s that half bear, at angles (a,) around the character.

    By logistic regression on the impulse's logarithm and on two harmonics of its angle, equal to
    the left and to the right. Angles are in rad from forwards, sizes in N s.
    """
    middle = np.log(sizes).mean()
    rows = np.column_stack((np.log(sizes) - middle, _harmonics(sides)))
    weights = np.zeros(rows.shape[1])
    for _ in range(STEPS):
        shares = 1.0 / (1.0 + np.exp(-rows @ weights))
        slope = rows.T @ (borne - shares) - RIDGE * weights
        curvature = (rows * (shares * (1.0 - shares))[:, np.newaxis]).T @ rows
        weights += np.linalg.solve(curvature + RIDGE * np.eye(len(weights)), slope)
    found: FloatArray = np.exp(middle - _harmonics(around) @ weights[1:] / weights[0])
    return found


def _harmonics(angles: FloatArray) -> FloatArray:
    return np.column_stack((np.ones(len(angles)), np.cos(angles), np.cos(2.0 * angles)))
