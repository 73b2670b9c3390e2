"""Probes the engine: one state of a character, one effort, one short step."""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError
from msgs_config.messages.probe import DynamicsSample
from sim_node.physics.mass_matrix import (
    INSTANT,
    clear_of_limits,
    measure_inverse_mass_matrix,
    passing_through_itself,
    still_settings,
)
from sim_node.physics.passive_forces import PassiveForces
from sim_node.physics.world import World

_SEED = 1
_ROOT_ENTRIES = 6
_TURN = 0.3  # rad or m that entries are away from the rest pose, at the most
_SPEED = 1.0  # rad/s or m/s, at the most
_ACCELERATION = 10.0  # rad/s^2 or m/s^2 that one effort alone leads to, at the most


def measure_probe(character: Character, gravity: float) -> DynamicsSample:
    """What the engine makes of a character in a state that has a bit of everything.

    The state is off the rest pose and within all limits; it moves in every degree of freedom. Each
    effort is such as to accelerate its own one by about as much as gravity does, so that none
    hides another.

    Args:
        character: The character.
        gravity: Gravity in m/s^2 along -z.

    Raises:
        CharacterError: some degree of freedom cannot move, or moves neither mass nor inertia.
    """
    layout = character.layout
    rng = np.random.default_rng(_SEED)
    position = _position(character, rng)
    velocity = rng.uniform(-_SPEED, _SPEED, layout.size)
    inverse_mass = measure_inverse_mass_matrix(character)
    yielding = np.diag(inverse_mass)
    _check_yielding(character, yielding)
    effort = rng.uniform(-_ACCELERATION, _ACCELERATION, layout.size) / yielding
    passive = PassiveForces(character, INSTANT, inverse_mass)
    with World(still_settings(gravity)) as world:
        body = world.add(passing_through_itself(character))
        body.set_state(position, velocity)
        position, velocity = body.read()  # as the engine has it
        energy = body.links.kinetic_energy()
        body.apply(effort + passive.effort(position, velocity))
        world.step()
        acceleration = (body.read()[1] - velocity) / INSTANT
    return DynamicsSample(position, velocity, effort, energy, acceleration)


def _position(character: Character, rng: np.random.Generator) -> FloatArray:
    """A position (n,) near the rest pose, away from hard limits and inside the soft ones."""
    rest = clear_of_limits(character)
    lower, upper = character.position_bounds()
    for joint in character.moving_joints:
        if joint.soft_limit is not None:
            entries = character.layout.joint(joint.name).entries
            lower[entries], upper[entries] = joint.soft_limit.lower, joint.soft_limit.upper
    room = np.minimum(rest - lower, upper - rest)
    return rest + rng.uniform(-1.0, 1.0, len(rest)) * np.minimum(_TURN, 0.5 * room)


def _check_yielding(character: Character, yielding: FloatArray) -> None:
    """Every degree of freedom yields to its effort, and none without resistance."""
    sound = (yielding > 0.0) & np.isfinite(yielding)
    if sound.all():
        return
    worst = int(np.argmin(sound))
    lower, upper = character.position_bounds()
    if character.layout.has_floating_base and worst < _ROOT_ENTRIES:
        reason = "the base link has no mass, so the engine holds it; 'fixed_base: true' says so too"
    elif lower[worst] == upper[worst]:
        reason = f"'{character.layout.dof_names[worst]}' has no room between its limits"
    else:
        reason = f"nothing with mass or inertia moves at '{character.layout.dof_names[worst]}'"
    raise CharacterError(f"{character.file}: {reason}")
