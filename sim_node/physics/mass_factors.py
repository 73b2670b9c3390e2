"""Links that are heavier, or lighter, than a character's file says."""

from collections.abc import Sequence
from dataclasses import replace

from msgs_config.character.model import Character, Link
from sim_node.named_numbers import named_numbers

ALL_LINKS = "all"
_BOUNDS = (0.01, 100.0)


def with_mass_factors(character: Character, factors: Sequence[str]) -> Character:
    """A character some of whose links have other masses, and inertia in the same proportion.

    Args:
        character: As its file says.
        factors: The parameter `mass_factors`, LINK:FACTOR each; one for `all` links comes on top.

    Raises:
        ConfigurationError: a link is not there, is named twice or has no mass, or a factor is not
            between 0.01 and 100.
    """
    if not factors:
        return character
    names = [link.name for link in character.links if link.mass]
    found = named_numbers("mass_factors", factors, "link", [ALL_LINKS, *names], _BOUNDS)
    for_all = found.get(ALL_LINKS, 1.0)
    links = (_heavier(link, for_all * found.get(link.name, 1.0)) for link in character.links)
    return replace(character, links=tuple(links))


def _heavier(link: Link, factor: float) -> Link:
    x, y, z = link.inertia_diagonal
    moments = (x * factor, y * factor, z * factor)
    return replace(link, mass=link.mass * factor, inertia_diagonal=moments, mass_factor=factor)
