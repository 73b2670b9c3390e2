"""How low the links of a character are: what stands on the ground, or is below it."""

from pathlib import Path

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel, still_model
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.model import Character, Shape, ShapeType
from msgs_config.geometry import fixed_order, rotations

_HARMLESS_DEPTH = 0.05  # m; motion capture puts feet that deep into the ground
_TOUCHING_DEPTH = 0.001  # m that a link which rests on the ground may be in it


def lowest_heights(character: Character, model: DynamicsModel) -> FloatArray:
    """Height z (links,) in m of the lowest point that each link collides with.

    It is infinite for a link that collides with nothing.

    Args:
        character: The character.
        model: Its model, in the state that is asked about.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    origins, turns_xyzw = model.link_poses()
    return np.array(
        [
            min((z + _lowest(shape, turn) for shape in link.collision_shapes), default=np.inf)
            for link, z, turn in zip(character.links, origins[:, 2], turns_xyzw, strict=True)
        ]
    )


def links_in_ground(character: Character) -> dict[str, float]:
    """How deep (m) the moving links of a fixed base are in the ground at the rest pose.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    if character.layout.has_floating_base:
        return {}
    heights = lowest_heights(character, still_model(character, np.array(character.rest_position)))
    links = zip(character.links[1:], heights[1:].tolist(), strict=True)
    return {link.name: -height for link, height in links if height < -_TOUCHING_DEPTH}


def describe_start_below_ground(character: Character, position: FloatArray) -> tuple[str, ...]:
    """A warning if a floating character begins deeper in the ground than contacts allow.

    Args:
        character: The character.
        position: The position (n,) that it begins in, message form.

    Raises:
        CharacterError: a mesh cannot be used.
    """
    if not character.layout.has_floating_base:
        return ()
    heights = lowest_heights(character, still_model(character, position))
    deepest = int(np.argmin(heights))
    if heights[deepest] >= -_HARMLESS_DEPTH:
        return ()
    return (
        f"it begins below the ground: link '{character.links[deepest].name}' is "
        f"{-heights[deepest]:.3g} m deep, and the engine throws it out; raise 'root_z' in "
        f"'initial_position' or 'rest_pose' by as much, or set 'terrain' to none",
    )


def _lowest(shape: Shape, turn_xyzw: FloatArray) -> float:
    """Height of a shape's lowest point over its link's origin, m; (4,) is the link's turn."""
    offset = rotations.rotate(turn_xyzw, np.array(shape.pose.position))[2]
    whole = rotations.multiply(turn_xyzw, np.array(shape.pose.orientation_xyzw))
    up = rotations.rotate(rotations.conjugate(whole), np.array((0.0, 0.0, 1.0)))
    return float(offset - _reach(shape, up))


def _reach(shape: Shape, up: FloatArray) -> float:
    """How far a shape reaches from its frame's origin against a unit vector (3,), m."""
    match shape.type:
        case ShapeType.BOX:
            return float(fixed_order.dot(0.5 * np.array(shape.size), np.abs(up)))
        case ShapeType.MESH:
            vertices = read_vertices(Path(shape.mesh)) * np.array(shape.size)
            return float(-fixed_order.dot(vertices, up).min())
        case ShapeType.SPHERE:
            return shape.size[0]
    radius, length = shape.size
    across = np.sqrt(max(1.0 - up[2] * up[2], 0.0)) if shape.type is ShapeType.CYLINDER else 1.0
    return float(0.5 * length * abs(up[2]) + radius * across)
