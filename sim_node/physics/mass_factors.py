"""Links that are heavier, or lighter, than a character's file says."""

from collections.abc import Sequence
from dataclasses import replace

from msgs_config.character.model import Character, Link
from sim_node.named_numbers import named_numbers

ALL_LINKS = "*"
_FACTORS = (1e-3, 1e3)  # least and most


def with_mass_factors(character: Character, factors: Sequence[str]) -> Character:
    """A character some of whose links have other masses, and inertia in the same proportion.

    Args:
        character: As its file says.
        factors: The parameter `mass_factors`, LINK:FACTOR each; several of one link multiply.

    Raises:
        ConfigurationError: there is no such link, or a factor is not between 0.001 and 1000.
    """
    by_link = dict.fromkeys((link.name for link in character.links), 1.0)
    for name, factor in named_numbers(
        "mass_factors", factors, "link", [ALL_LINKS, *by_link], _FACTORS
    ):
        for each in by_link if name == ALL_LINKS else [name]:
            by_link[each] *= factor
    if all(factor == 1.0 for factor in by_link.values()):
        return character
    pairs = zip(character.links, by_link.values(), strict=True)
    return replace(character, links=tuple(_heavier(link, factor) for link, factor in pairs))


def _heavier(link: Link, factor: float) -> Link:
    x, y, z = link.inertia_diagonal
    moments = (x * factor, y * factor, z * factor)
    return replace(link, mass=link.mass * factor, inertia_diagonal=moments, mass_factor=factor)
