"""MuJoCo's model of a simulated world: the ground, characters and balls."""

import copy
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace

import mujoco

from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Joint, Link, Pose
from msgs_config.character.mujoco_model import compile_for_contacts
from msgs_config.character.mujoco_world import (
    Contacts,
    add_body,
    add_character,
    add_ground,
    set_options,
)
from msgs_config.character.terrain import terrain_shapes
from msgs_config.errors import CharacterError
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.runtime.fork_safe import fork_safe_lock
from sim_node.physics.settings import WorldSettings

_MOST_KEPT_MODELS = 8  # compiled models, of which the same worlds are made again

_keeping = fork_safe_lock()  # worlds may be made in several threads
_kept: OrderedDict[object, tuple[tuple[Character, ...], mujoco.MjModel]] = OrderedDict()


def compile_world(
    characters: Sequence[Character], balls: Sequence[ProjectileThrow], settings: WorldSettings
) -> mujoco.MjModel:
    """The model of a world: first the characters' links, then the balls, in their order.

    Raises:
        CharacterError: a file cannot be used, or MuJoCo refuses what it says.
    """
    # Characters are compared by identity, and kept with the model, so that none takes another's.
    shapes = tuple((ball.mass, ball.shape) for ball in balls)
    key = (*map(id, characters), shapes, replace(settings, gravity=0.0))
    with _keeping:
        if key not in _kept:
            _kept[key] = (tuple(characters), _compile(characters, balls, settings))
            while len(_kept) > _MOST_KEPT_MODELS:
                _kept.popitem(last=False)
        _kept.move_to_end(key)
        return copy.copy(_kept[key][1])


def ball_link(number: int, throw: ProjectileThrow) -> Link:
    """A ball as a body of one link: a solid sphere, or a box."""
    joint, inertia = Joint(f"ball {number}", JointType.FLOATING), _inertia(throw)
    return Link(f"ball {number}", -1, joint, throw.mass, inertia, Pose(), (), (throw.shape,))


def _inertia(throw: ProjectileThrow) -> tuple[float, float, float]:
    """The moments of inertia of a solid sphere or box about its axes, kg m^2."""
    if throw.size is None:
        (radius,) = throw.shape.size
        return (0.4 * throw.mass * radius * radius,) * 3
    x, y, z = (edge * edge for edge in throw.size)
    twelfth = throw.mass / 12.0
    return twelfth * (y + z), twelfth * (x + z), twelfth * (x + y)


def _compile(
    characters: Sequence[Character], balls: Sequence[ProjectileThrow], settings: WorldSettings
) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False  # limits are in rad
    contacts = Contacts(
        settings.step_s,
        settings.friction * settings.link_friction,
        settings.link_friction * settings.link_friction,
        settings.solver_iterations,
    )
    set_options(spec.option, contacts, settings.gravity)
    terrain = [] if settings.terrain is None else terrain_shapes(settings.terrain)
    add_ground(spec, contacts, plane=settings.ground, shapes=terrain)
    for number, character in enumerate(characters):
        add_character(spec, f"{number}/", character, contacts)
    ball_links = [ball_link(number, throw) for number, throw in enumerate(balls)]
    for link in ball_links:
        add_body(spec, "", [link], contacts)
    links = [link for character in characters for link in character.links] + ball_links
    try:
        model = compile_for_contacts(spec, links)
    except (ValueError, mujoco.FatalError) as error:
        files = [str(each.file) for each in characters]
        if settings.terrain is not None:
            files.append(str(settings.terrain.urdf_path))
        reason = str(error).strip().replace("\n", "; ")
        raise CharacterError(f"{', '.join(files)}: not usable by MuJoCo: {reason}") from error
    return model
