"""A named set of trials: kinds of rows, each a sweep, and what is asked of the character."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from actuated_characters.sweep.file import PARTS, open_file, sweep_of
from actuated_characters.sweep.grid import Axis, Row, expand, rows_to_check
from actuated_characters.trial.controller_file import Controller
from actuated_characters.trial.goal import Goal, read_goal
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.files import read_text
from msgs_config.mappings import MappingReader

FIGURES = (
    *("survived", "failed_at_s", "travelled_m", "joint_error_mean_rad"),
    *("ticks", "sim_time_s", "actuators", "root_actuators", "saturated_fraction"),
)
"""Of a trial: measured on the world, and the same whenever and wherever it is run again. Commands
that came twice or were rejected are not: a busy machine has more of them."""
KIND = "kind"
"""The column that says which part of the set a row is of."""
_SHIPPED = Path(__file__).parent / "data"
_ENGINE = "sim_node.engine"
_MOST_CHECKED = 50  # rows of a kind that are planned before the first one runs


@dataclass(frozen=True)
class Kind:
    """Rows of a set that go together."""

    name: str
    axes: Sequence[Axis]
    rows: Sequence[Row]
    goal: Goal

    def to_check(self) -> list[Row]:
        """Rows that have all of its choices."""
        return rows_to_check(self.axes, self.rows, _MOST_CHECKED)


@dataclass(frozen=True)
class TrialSet:
    """All rows of a set, for one controller."""

    path: Path  # of the file
    about: str
    text: str  # the file's
    kinds: Sequence[Kind]
    bags: str  # which are kept

    @property
    def name(self) -> str:
        """The file's name without its suffix."""
        return self.path.stem

    @property
    def rows(self) -> list[Row]:
        """All rows, numbered from 1 on."""
        return [row for kind in self.kinds for row in kind.rows]

    def goals(self) -> dict[int, Goal]:
        """What is asked in each row, by its number."""
        return {row.number: kind.goal for kind in self.kinds for row in kind.rows}


def shipped_sets() -> list[str]:
    """The names of the sets that come with the package."""
    return sorted(path.stem for path in _SHIPPED.glob("*.yaml"))


def find_set(name: str, folder: Path = Path()) -> Path:
    """The file of a set that is given by its name, or by a path that is relative to a folder.

    Raises:
        ConfigurationError: there is none of that name.
    """
    if Path(name).suffix:
        return folder / name
    if name not in shipped_sets():
        sentence = one_of("set of trials", name, shipped_sets())
        raise ConfigurationError(f"{sentence}; or the path of a .yaml file")
    return _SHIPPED / f"{name}.yaml"


def read_set(
    path: Path, controller: Controller, options: Mapping[str, bool], engine: str
) -> TrialSet:
    """Read a set's file for a controller, which adds the options and parameters that it needs.

    Args:
        path: Of the file.
        controller: Who is on trial.
        options: Those of the command `run` that rows may have; see `read_sweep`.
        engine: Simulates the rows, unless the set or the controller says which one.

    Raises:
        ConfigurationError: something in it is wrong, or contradicts the controller.
    """
    reader = open_file(path, "a set of trials", (*PARTS, "bags", "about", "goal", "trials"))
    about = reader.text("about") if "about" in reader.content else ""
    bags = reader.choice("bags", ["failures", "none", "all"])
    kinds = list(_kinds(reader, controller, options, engine))
    return TrialSet(path, about, read_text(path, ConfigurationError), kinds, bags)


def _kinds(
    reader: MappingReader, controller: Controller, options: Mapping[str, bool], engine: str
) -> Iterator[Kind]:
    parts = reader.parts("trials", (*PARTS, "goal"))
    if "trials" in reader.content and not parts:
        raise reader.wrong("trials", reader.content["trials"], "a mapping of kinds of trials")
    first = 1
    for name, part in parts.items() or {Path(str(reader.place)).stem: None}.items():
        place = f"{reader.place} ({name})" if part else str(reader.place)
        merged = _merged(reader, part)
        _add_needs(place, merged, controller)
        merged["set"].setdefault(_ENGINE, engine)
        axes = sweep_of(
            MappingReader(place, merged, ConfigurationError), options, (*FIGURES, KIND)
        ).axes
        rows = [
            replace(row, number=number, cells={KIND: name, **row.cells})
            for number, row in enumerate(expand(axes), start=first)
        ]
        first += len(rows)
        goal = {**reader.part("goal").content, **(part.part("goal").content if part else {})}
        yield Kind(
            name, axes, rows, read_goal(MappingReader(place, goal, ConfigurationError, "goal."))
        )


def _merged(common: MappingReader, part: MappingReader | None) -> dict[str, Any]:
    """A sweep of what all kinds have in common and of what one of them has."""
    readers = [common] if part is None else [common, part]
    merged: dict[str, Any] = {}
    for key in ("run", "set", "values"):
        merged[key] = {
            name: value for each in readers for name, value in each.part(key).content.items()
        }
    for key in ("random", "seeds"):
        given = [each.content[key] for each in readers if key in each.content]
        if given:
            merged[key] = given[-1]
    texts = json.dumps([merged["run"], merged["set"]], ensure_ascii=False)
    own = set() if part is None else set(part.part("values").content)
    merged["values"] = {
        name: value
        for name, value in merged["values"].items()
        if part is None or name in own or f"{{{name}}}" in texts
    }
    return merged


def _add_needs(place: str, merged: dict[str, Any], controller: Controller) -> None:
    """Add a controller's options and parameters, which must not contradict the set's."""
    for key, needs in (("run", controller.run), ("set", controller.set)):
        for name, value in needs.items():
            if merged[key].setdefault(name, value) != value:
                raise ConfigurationError(
                    f"{place}: {key}.{name} is {merged[key][name]}, and controller "
                    f"'{controller.name}' needs {value}; choose other trials"
                )
