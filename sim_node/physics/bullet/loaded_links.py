"""The links that Bullet has made of a URDF, compared with the character's."""

from collections.abc import Sequence

import numpy as np

from msgs_config.character.model import Character, Pose
from msgs_config.errors import CharacterError
from sim_node.physics.bullet.client import Engine, pybullet

_MAX_DIFFERENCE = 1e-9  # share of the largest entry


def check_links(client: Engine, body: int, numbers: Sequence[int], character: Character) -> None:
    """Compare the mass, centre of mass and inertia of a body's links with the character's.

    `numbers` are the engine's, a link each. What the engine has is needed for its own state to be
    read: it goes by the links' inertial frames.

    Raises:
        CharacterError: they differ; names the link, the quantity and both values.
    """
    for link, number in zip(character.links, numbers, strict=True):
        mass, _, moments, centre, turn_xyzw = pybullet.getDynamicsInfo(
            body, number, physicsClientId=client
        )[:5]
        loaded = Pose(centre, turn_xyzw)
        if (mass, moments, loaded) == (link.mass, link.inertia_diagonal, link.inertial_pose):
            continue
        own = link.inertial_pose
        for what, read, expected in (
            ("a mass in kg", mass, link.mass),
            ("an inertia in kg m^2", moments, link.inertia_diagonal),
            ("a centre of mass in m", centre, own.position),
            ("principal axes (xyzw)", turn_xyzw, own.orientation_xyzw),
        ):
            size = max(np.abs(read).max(), np.abs(expected).max())
            if not np.abs(np.subtract(read, expected)).max() <= _MAX_DIFFERENCE * size:
                values = [" ".join(f"{v:.6g}" for v in np.ravel(each)) for each in (read, expected)]
                raise CharacterError(
                    f"{character.loading.urdf_path}: link '{link.name}': the engine has {what} of "
                    f"{values[0]}; the URDF's text has {values[1]}"
                )
