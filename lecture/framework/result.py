"""The result of a study: table, pictures, the curves behind them, remarks; and their files."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from actuated_characters.render.plots import make_panels
from msgs_config.arrays import FloatArray

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from actuated_characters.render.engine.renderer import Picture

Cell = str | int | float | bool | None
"""A field of a table; None where there is no value."""

Row = Mapping[str, Any]
"""One row of a table: each cell by the name of its column, which has the unit."""

_DPI = 110


class StudyResult:
    """Filled by a study while its runs are made."""

    def __init__(self, name: str) -> None:
        """`name` is the study's; the table and the pictures without another name have it."""
        self.name = name
        self.rows: list[Row] = []  # rows of the table; each has the same columns
        self.figures: dict[str, Figure] = {}  # figures by the names of their files
        # by the name of a CSV file: columns (t,) by their names
        self.curves: dict[str, Mapping[str, FloatArray]] = {}
        self.remarks: list[str] = []  # sentences about the result

    @property
    def columns(self) -> list[str]:
        """The names of the table's columns."""
        return list(self.rows[0])

    def column(self, name: str) -> list[Any]:
        """The cells of a column of the table."""
        return [row[name] for row in self.rows]

    def add_curves(self, name: str, columns: Mapping[str, FloatArray]) -> None:
        """Add curves (t,) by their names; those that end early are NaN from there on."""
        assert name != self.name, "the table has that file's name"
        longest = max(map(len, columns.values()))
        self.curves[name] = {
            header: np.pad(column, (0, longest - len(column)), constant_values=np.nan)
            for header, column in columns.items()
        }

    def add_panels(
        self,
        name: str,
        rows: int,
        columns: int,
        size: tuple[float, float],
        *,
        title: str = "",
        same_x: bool | Literal["row"] = False,
    ) -> "list[Axes]":
        """Add a figure of a size in inches; returns its empty panels row by row."""
        figure, panels = make_panels(rows, columns, size, same_x=same_x)
        if title:
            figure.suptitle(title)
        self.figures[name] = figure
        return panels

    def add_pictures(
        self,
        name: str,
        pictures: "Mapping[str, Picture]",
        *,
        width: float = 12.0,
        title_height: float = 0.3,
        title_place: Literal["left", "center"] = "left",
    ) -> None:
        """Add a figure of rendered pictures, each below its title; width and height in inches."""
        height, columns = next(iter(pictures.values())).shape[:2]
        tall = len(pictures) * (width * height / columns + title_height)
        panels = self.add_panels(name, len(pictures), 1, (width, tall))
        for panel, (title, picture) in zip(panels, pictures.items(), strict=True):
            panel.set_axis_off()
            panel.imshow(picture)
            panel.set_title(title, fontsize="medium", loc=title_place)

    def write(self, directory: Path) -> list[Path]:
        """Write table (CSV), curves (CSV) and pictures (PNG and SVG); returns the files."""
        directory.mkdir(parents=True, exist_ok=True)
        files = [directory / f"{self.name}.csv"]
        with files[0].open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, self.columns)
            writer.writeheader()
            writer.writerows(self.rows)
        for stem, columns in self.curves.items():
            files.append(directory / f"{stem}.csv")
            values, header = np.column_stack(list(columns.values())), ",".join(columns)
            np.savetxt(files[-1], values, delimiter=",", header=header, comments="", fmt="%.9g")
        for stem, figure in self.figures.items():
            for suffix in ("png", "svg"):
                files.append(directory / f"{stem}.{suffix}")
                figure.savefig(files[-1], dpi=_DPI)
        return files
