"""The engine probed by short steps: a character's inverse mass matrix, and one dynamics sample."""

from dataclasses import replace

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError
from msgs_config.messages.probe import DynamicsSample
from sim_node.physics.engine import DEFAULT_ENGINE, Body, World, make_world
from sim_node.physics.settings import WorldSettings

INSTANT = 1e-7
"""An engine step, s, so short that a difference quotient over it is a derivative."""

_SEED = 1
_ROOT_ENTRIES = 6
_TURN = 0.3  # rad or m that entries are away from the rest pose, at the most
_SPEED = 1.0  # rad/s or m/s, at the most
# Damping is a derivative as long as it takes no larger share of a speed in an instant.
_MAX_DAMPED_SHARE = 1e-3
_ACCELERATION = 10.0  # rad/s^2 or m/s^2 that one effort alone leads to, at the most


def still_settings(gravity: float, engine: str = DEFAULT_ENGINE) -> WorldSettings:
    """A world without ground, which advances by an instant."""
    return WorldSettings(engine=engine, step_s=INSTANT, gravity=gravity, ground=False)


def measure_probe(
    character: Character, gravity: float, engine: str = DEFAULT_ENGINE
) -> DynamicsSample:
    """What the engine makes of a character: one dynamics sample.

    The sample's state is off the rest pose and within all limits; it moves in every degree of
    freedom but those that passive damping would stop within an instant. Each effort is such as to
    accelerate its own one by about as much as gravity does, so that none hides another.

    Args:
        character: The character.
        gravity: Gravity in m/s^2 along -z.
        engine: The engine.

    Raises:
        CharacterError: some degree of freedom cannot move, or moves neither mass nor inertia.
    """
    layout = character.layout
    if layout.has_floating_base and not character.links[0].mass:
        reason = "the base link has no mass, so that it cannot float; 'fixed_base: true' holds it"
        raise CharacterError(f"{character.file}: {reason}")
    rng = np.random.default_rng(_SEED)
    position = _position(character, rng)
    velocity = rng.uniform(-_SPEED, _SPEED, layout.size)
    with make_world(still_settings(0.0, engine)) as world:
        body = _add_without_collisions(world, character)
        inverse_mass = _inverse_mass_matrix(world, body, character)
        _check_inverse_mass(character, np.diag(inverse_mass))
        effort = rng.uniform(-_ACCELERATION, _ACCELERATION, layout.size) / np.diag(inverse_mass)
        rate = character.passive_damping() * np.diag(inverse_mass)
        velocity[rate * INSTANT > _MAX_DAMPED_SHARE] = 0.0
        world.set_gravity(gravity)
        body.set_state(position, velocity)
        position, velocity = body.read()  # the state that the engine has made of it
        energy = body.kinetic_energy()
        body.apply(effort - character.passive_damping() * velocity)
        world.step()
        acceleration = (body.read()[1] - velocity) / INSTANT
    if not body.has_armature:  # which resists as a passive force there: it is a part of the effort
        effort = effort + character.armature() * acceleration
    return DynamicsSample(position, velocity, effort, energy, acceleration)


def _add_without_collisions(world: World, character: Character) -> Body:
    """Put a character into a world, its links passing through each other, its joints free."""
    loading = replace(character.loading, self_collision=False)
    return world.add(replace(character.without_constraints(), loading=loading))


def _inverse_mass_matrix(world: World, body: Body, character: Character) -> FloatArray:
    """The inverse mass matrix (n, n) near the rest pose: what a unit of each effort accelerates.

    The world must be one of `still_settings` without gravity.
    """
    size = character.layout.size
    rest, still = _clear_of_limits(character), np.zeros(size)
    inverse_mass = np.zeros((size, size))
    for column, effort in enumerate(np.eye(size)):
        body.set_state(rest, still)
        body.apply(effort)
        world.step()
        inverse_mass[:, column] = body.read()[1] / INSTANT
    return inverse_mass


def _clear_of_limits(character: Character) -> FloatArray:
    """The rest pose (n,), with each joint a tenth of its range or more from its limits.

    At a limit the engine's own constraint would answer to an effort as well.
    """
    lower, upper = character.position_bounds()
    limited = np.isfinite(lower) & np.isfinite(upper)
    margin = 0.1 * np.subtract(upper, lower, out=np.zeros_like(lower), where=limited)
    return np.clip(character.rest_position, lower + margin, upper - margin)


def _position(character: Character, rng: np.random.Generator) -> FloatArray:
    """A position (n,) near the rest pose, away from hard limits and inside the soft ones."""
    rest = _clear_of_limits(character)
    lower, upper = character.position_bounds()
    for joint in character.moving_joints:
        if joint.soft_limit is not None:
            entries = character.layout.joint(joint.name).entries
            lower[entries], upper[entries] = joint.soft_limit.lower, joint.soft_limit.upper
    room = np.minimum(rest - lower, upper - rest)
    return rest + rng.uniform(-1.0, 1.0, len(rest)) * np.minimum(_TURN, 0.5 * room)


def _check_inverse_mass(character: Character, inverse_mass_diagonal: FloatArray) -> None:
    """Raise CharacterError unless each effort accelerates its entry, by a finite amount (n,)."""
    sound = (inverse_mass_diagonal > 0.0) & np.isfinite(inverse_mass_diagonal)
    if sound.all():
        return
    worst = int(np.argmin(sound))
    if character.layout.has_floating_base and worst < _ROOT_ENTRIES:
        reason = (
            f"the base link has {character.links[0].mass:g} kg but no inertia; 'inertia: shapes' "
            "in a .yaml file takes that of its shapes"
        )
    else:
        reason = f"nothing with mass or inertia moves at '{character.layout.dof_names[worst]}'"
    raise CharacterError(f"{character.file}: {reason}")
