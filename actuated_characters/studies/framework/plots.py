"""What the studies' figures share."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from msgs_config.arrays import FloatArray

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from actuated_characters.render.engine.renderer import Picture

_WIDTH, _TITLE = 12.0, 0.3  # inches, of a figure of pictures and of a name in it

THEORY: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.0}
"""How a line of theory is drawn."""


def make_panels(
    rows: int, columns: int, size: tuple[float, float], *, same_x: bool = False
) -> "tuple[Figure, list[Axes]]":
    """An empty figure of a size in inches, and its panels row by row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=same_x)
    return figure, list(grid.flat)


def label(axes: "Axes", x: str, y: str, title: str = "", *, legend: Any = "best") -> None:
    """Name what a panel shows, with units; `legend` is where that lies, None for no legend."""
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


def show_pictures(pictures: "Mapping[str, Picture]", *, columns: int = 1) -> "Figure":
    """Rendered pictures row by row in a figure, each below its name."""
    rows = -(-len(pictures) // columns)
    height, width = next(iter(pictures.values())).shape[:2]
    tall = _WIDTH / columns * height / width + _TITLE
    figure, panels = make_panels(rows, columns, (_WIDTH, rows * tall))
    for panel in panels:
        panel.set_axis_off()
    for panel, (name, picture) in zip(panels, pictures.items(), strict=False):
        panel.imshow(picture)
        panel.set_title(name, fontsize="medium", loc="left")
    return figure
