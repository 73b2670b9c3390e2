"""How a character's joints yield to efforts: the inverse mass matrix, as the engine has it."""

from collections import deque
from dataclasses import replace

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from sim_node.physics.passive_forces import PassiveForces
from sim_node.physics.world import World, WorldSettings

_MEASURED = deque[tuple[Character, FloatArray]](maxlen=4)  # one has no hash

INSTANT = 1e-7
"""An engine step, s, so short that a difference quotient over it is a derivative."""


def still_settings(gravity: float) -> WorldSettings:
    """A world without ground, which advances by an instant."""
    return WorldSettings(step_s=INSTANT, gravity=gravity, ground=False)


def passing_through_itself(character: Character) -> Character:
    """The character without collisions between its links."""
    return replace(character, loading=replace(character.loading, self_collision=False))


def clear_of_limits(character: Character) -> FloatArray:
    """The rest pose (n,), with each joint a tenth of its range or more from its limits.

    At a limit the engine's own constraint would answer to an effort as well.
    """
    lower, upper = character.position_bounds()
    limited = np.isfinite(lower) & np.isfinite(upper)
    margin = 0.1 * np.subtract(upper, lower, out=np.zeros_like(lower), where=limited)
    return np.clip(character.rest_position, lower + margin, upper - margin)


def measure_inverse_mass_matrix(character: Character) -> FloatArray:
    """The inverse mass matrix (n, n) near the rest pose: what a unit of each effort accelerates.

    A character's is measured once: both its passive forces and its probe need it.
    """
    for known, inverse_mass in _MEASURED:
        if known is character:
            return inverse_mass
    size = character.layout.size
    rest, still = clear_of_limits(character), np.zeros(size)
    inverse_mass = np.zeros((size, size))
    with World(still_settings(gravity=0.0)) as world:
        body = world.add(passing_through_itself(character))
        for column, effort in enumerate(np.eye(size)):
            body.set_state(rest, still)
            body.apply(effort)
            world.step()
            inverse_mass[:, column] = body.read()[1] / INSTANT
    inverse_mass.setflags(write=False)
    _MEASURED.append((character, inverse_mass))
    return inverse_mass


def make_passive_forces(character: Character, step_s: float) -> PassiveForces:
    """The passive forces of a character's joints at engine steps of `step_s`."""
    is_passive = [joint.damping or joint.soft_limit for joint in character.moving_joints]
    size = character.layout.size
    inverse_mass = (
        measure_inverse_mass_matrix(character) if any(is_passive) else np.zeros((size, size))
    )
    return PassiveForces(character, step_s, inverse_mass)
