"""The common look of the figures of studies and reports."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from msgs_config.arrays import FloatArray

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

THEORY: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.0}
"""The style of a line of theory."""


def make_panels(
    rows: int, columns: int, size: tuple[float, float], *, same_x: bool | Literal["row"] = False
) -> "tuple[Figure, list[Axes]]":
    """An empty figure of a size in inches, and its panels row by row.

    `same_x` says which of them share their axis: all, or those of a row.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=same_x)
    return figure, list(grid.flat)


def label(axes: "Axes", x: str, y: str, title: str = "", *, legend: Any = "best") -> None:
    """Label a panel's axes, with units; `legend` is the place of its legend, None for none."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)
    if legend is not None:
        axes.legend(loc=legend, fontsize="small")


def draw_over_theory(
    axes: "Axes",
    times: FloatArray,
    simulated: FloatArray,
    theory: FloatArray,
    names: Sequence[str],
) -> None:
    """Curves (t, k) at times (t,), each by its name, and those of theory (t, k) over them."""
    for column, name in enumerate(names):
        axes.plot(times, simulated[:, column], linewidth=2.5, alpha=0.7, label=name)
        named = "theory" if column == len(names) - 1 else None
        axes.plot(times, theory[:, column], label=named, **THEORY)
