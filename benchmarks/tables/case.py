"""One run of many: what it is told, as `actuated_characters run` is, and its row of a table."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import yaml

from actuated_characters.commands.common.settings import NODES, node_settings
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.velocities import plan_velocities
from msgs_config.character.loading import load_character
from msgs_config.errors import ConfigurationError

Fact: TypeAlias = bool | float | str | None
"""A yes or no is counted, of a number the median is told, a text or None is listed or left out."""


@dataclass(frozen=True)
class Case:
    """A run with the options of `actuated_characters run`, and the row of the table that it is of.

    It ends sooner by a fall or, where it `follows`, as soon as it has lost its reference.
    """

    row: str
    seconds: float
    reference: Mapping[str, object] = field(default_factory=dict)
    simulator: Mapping[str, object] = field(default_factory=dict)
    controller: Mapping[str, object] = field(default_factory=dict)
    pushes: Sequence[str] = ()  # as `--push` has them
    throws: Sequence[str] = ()  # as `--throw` has them
    commands: str = ""  # as `--cmd-vel` has them
    since: float = 0.0  # s, from which on it is measured
    until_fall: bool = True
    follows: bool = False
    settings: Sequence[str] = ()  # as `--set` has them; they take precedence
    character: str = "humanoid"
    world: str = ""  # the character that is simulated, where the controller takes it for another
    facts: Mapping[str, Fact] = field(default_factory=dict)  # known before the run

    def plan(self, character: str = "") -> RunPlan:
        """The run; raises ActuatedCharactersError if there is none."""
        given = node_settings(list(self.settings), NODES)
        plan = make_plan(
            character or self.world or self.character,
            self.seconds,
            self.reference,
            {**self.simulator, **given["sim_node"]},
            {**self.controller, **given["controller_node"]},
        )
        return plan_velocities(plan, self.commands)[0] if self.commands else plan


def heavier(character: str, factor: float, folder: Path) -> str:
    """The file of a character whose links are heavier by a factor.

    Raises:
        ConfigurationError: the inertia of its links is not that of their shapes.
    """
    file = load_character(character).file
    content = yaml.safe_load(file.read_text("utf-8"))
    if content.get("inertia") != "shapes":
        raise ConfigurationError("--mass is for a character whose inertia is that of its shapes")
    urdf = load_character(character).loading.urdf_path
    text = re.sub(
        r'(<mass\s+value\s*=\s*")([^"]+)',
        lambda found: f"{found[1]}{factor * float(found[2])!r}",
        urdf.read_text("utf-8"),
    )
    (folder / urdf.name).write_text(text, "utf-8")
    (folder / file.name).write_text(yaml.safe_dump(content | {"urdf": urdf.name}), "utf-8")
    return str(folder / file.name)
