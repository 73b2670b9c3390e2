"""The links that the engine has made of a URDF, compared with the URDF's own text.

Both sides build on what the engine has read, so that their agreement cannot see it read wrongly.
"""

import math
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from msgs_config.character.model import Link, UrdfOptions
from msgs_config.character.urdf.inertia import read_inertial
from msgs_config.errors import CharacterError

_MAX_DIFFERENCE = 1e-9  # share of the largest entry


def check_links(links: Sequence[Link], repaired: ElementTree.Element, loading: UrdfOptions) -> None:
    """Compare each link's mass, centre of mass and inertia with a repaired URDF, mass in all too.

    The mass in all is that of the text before its repair, if it has any. A fixed base, which cannot
    move, has no mass in the engine. With `inertia: shapes` there is no inertia to compare.

    Raises:
        CharacterError: they differ; names the link, the quantity and both values.
    """
    elements = {link.get("name", ""): link for link in repaired.findall("link")}
    moving = links[1:] if loading.fixed_base else links
    for link in moving:
        given = read_inertial(elements[link.name])
        centre = loading.scale * np.array(given.pose.position)
        pairs: list[tuple[str, ArrayLike, ArrayLike]] = [
            ("a mass in kg", link.mass, given.mass),
            ("a centre of mass in m", link.inertial_pose.position, centre),
        ]
        if loading.inertia_from_file:
            own = link.inertia_in_link_axes()
            pairs.append(("an inertia in kg m^2", own, given.in_link_axes()))
        for what, read, expected in pairs:
            _compare(f"{loading.urdf_path}: link '{link.name}'", what, read, expected)
    total = _mass(loading.robot)
    if loading.fill_inertia and total == 0.0:
        total = _mass(repaired)
    mass = math.fsum(link.mass for link in moving)
    if loading.fixed_base:
        mass += read_inertial(elements[links[0].name]).mass
    _compare(f"{loading.urdf_path}: all links", "a mass in kg", mass, total)


def _mass(robot: ElementTree.Element) -> float:
    return math.fsum(read_inertial(link).mass for link in robot.findall("link"))


def _compare(where: str, what: str, read: ArrayLike, given: ArrayLike) -> None:
    size = max(np.abs(read).max(), np.abs(given).max())
    if not np.abs(np.subtract(read, given)).max() <= _MAX_DIFFERENCE * size:
        values = [" ".join(f"{value:.6g}" for value in np.ravel(side)) for side in (read, given)]
        raise CharacterError(
            f"{where}: the engine has {what} of {values[0]}; the URDF's text has {values[1]}"
        )
