"""The options that give characters a skin from a file."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a while to import
    from actuated_characters.render.skin.given import GivenSkin


def add_skin(command: argparse._ActionsContainer, prefix: str = "") -> None:
    """Add the options; `prefix` stands before what help says of them."""
    command.add_argument(
        "--skin",
        type=Path,
        metavar="FILE",
        help=f"{prefix}a skinned mesh (.glb) as the body of every character",
    )
    command.add_argument(
        "--skin-map",
        type=Path,
        metavar="FILE",
        help=f"{prefix}a YAML file of its joints by links, such as 'left_knee: LeftLeg'; those "
        "left out are found by their names",
    )


def given_skin(options: argparse.Namespace) -> "GivenSkin | None":
    """The skin that the options name, read; None: none.

    Raises:
        ActuatedCharactersError: it cannot be used, or another option is against it.
    """
    if options.skin is None:
        if options.skin_map is not None:
            raise ConfigurationError("--skin-map is of a --skin; name one")
        return None
    if getattr(options, "shapes", False):
        raise ConfigurationError("--skin and --shapes: give one of the two")
    from actuated_characters.render.skin.given import GivenSkin

    return GivenSkin.read(options.skin, options.skin_map)


def skin_parameters(options: argparse.Namespace) -> dict[str, object]:
    """The viewer's parameters of those options, which are known to be of files that can be read."""
    if given_skin(options) is None:
        return {}
    paths = {"skin": options.skin, "skin_map": options.skin_map}
    return {name: str(path.absolute()) for name, path in paths.items() if path is not None}
