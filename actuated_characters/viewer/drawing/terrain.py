"""The ground where it is more than a plane."""

import numpy as np
import viser

from actuated_characters.render.engine.shape_meshes import surface_of
from msgs_config.arrays import FloatArray
from msgs_config.character.model import UrdfOptions
from msgs_config.character.terrain import is_plane, terrain_shapes
from msgs_config.geometry import rotations

_COLOR = (164, 176, 194)


def draw_terrain(scene: viser.SceneApi, name: str, terrain: UrdfOptions) -> FloatArray:
    """Add a terrain's shapes below a name in the scene; the ground is there for its planes.

    Returns the corners (k, 3) of their surfaces, m, world.

    Raises:
        CharacterError: the URDF or a mesh of it cannot be used; names the file.
    """
    corners = [np.empty((0, 3))]
    for number, shape in enumerate(terrain_shapes(terrain)):
        if is_plane(shape):
            continue
        vertices, _, faces = surface_of(shape)
        turn = np.array(shape.pose.orientation_xyzw)
        corners.append(rotations.rotate(turn, vertices) + np.array(shape.pose.position))
        scene.add_mesh_simple(
            f"{name}/{number}",
            vertices,
            faces,
            color=_COLOR,
            flat_shading=True,
            wxyz=rotations.wxyz_from_xyzw(turn),
            position=shape.pose.position,
        )
    return np.concatenate(corners)
