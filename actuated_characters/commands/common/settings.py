"""Options that may be repeated, and what `--set NODE.NAME:=VALUE` says."""

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from msgs_config import files
from msgs_config.errors import ConfigurationError, one_of

if TYPE_CHECKING:  # it takes a while to import
    from controller_node.references.files.reconstructed import FoundWith


def add_repeated(command: argparse._ActionsContainer, name: str, metavar: str, about: str) -> None:
    """Add an option whose values are a list, empty by default."""
    about = f"{about}; may be repeated"
    command.add_argument(name, action="append", default=[], metavar=metavar, help=about)


def node_settings(texts: Sequence[str], nodes: Sequence[str]) -> dict[str, dict[str, object]]:
    """The parameters that are set, by node; values are YAML.

    Raises:
        ConfigurationError: a text is not of that form, its node is none of these, or its value is
            no YAML.
    """
    node_name = nodes[0] if len(nodes) == 1 else "NODE"
    settings: dict[str, dict[str, object]] = {node: {} for node in nodes}
    for text in texts:
        name, assigns, value = text.partition(":=")
        node, dot, parameter = name.partition(".")
        if not (assigns and dot and parameter):
            raise ConfigurationError(f"--set {text}: write it as {node_name}.NAME:=VALUE")
        if node not in settings:
            raise ConfigurationError(f"--set {text}: {one_of('node', node, list(nodes))}")
        settings[node][parameter] = files.parse_yaml(f"--set {text}", value, ConfigurationError)
    return settings


def bring_parameters(
    character: str,
    clip: str | None,
    simulator: dict[str, object],
    controller: dict[str, object],
) -> "FoundWith | None":
    """Set what a clip was found with, unless it is set, if it is a reconstruction.

    Returns all that it was found with, None of other clips.

    Raises:
        ActuatedCharactersError: there is no such character or clip, or its file is malformed.
    """
    from actuated_characters.runs.plan import SHARED
    from controller_node.references.files.reconstructed import SUFFIX, ReconstructedClip
    from msgs_config.character.loading import load_character

    if clip is None or not clip.endswith(SUFFIX):
        return None
    found = ReconstructedClip(load_character(character), clip).found_with
    if found is None:
        return None
    taken = {name for name in SHARED if name in simulator or name in controller}
    for settings, brought in ((simulator, found.simulator), (controller, found.controller)):
        settings.update(
            {name: brought[name] for name in brought if name not in (*settings, *taken)}
        )
    return found
