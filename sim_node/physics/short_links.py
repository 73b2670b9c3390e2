"""The largest speed of a character that an engine step is too long for.

What a hinge carries swings as a pendulum of the length `l = I / (m r)`, with its inertia I and its
mass m, whose centre is r off the axis (Huygens 1673). Where its holder is stopped at a speed v it
goes on with `v / l`: a finger of 2 cm, at 5 m/s, with 250 rad/s, a radian in a step of 1/240 s. An
engine that takes mass matrix and Coriolis forces from the beginning of a step cannot follow that;
in a chain of such links the energy grows from step to step. Neither their mass nor limits alter
it: fingers of 4 g and of 400 g do the same, with limits and without. So the engine keeps a bound on
the speeds of such a character, as it does by itself in all others: Bullet's own at 240 Hz.

A robot whose fixed base puts its links into the ground is pushed out of it. A link that can only
turn about itself, such as an arm's first one, moves up by as little as its centre is off its axis,
so that the engine turns it by thousands of rad/s. Such a robot has the same bound.
"""

import math
from collections.abc import Sequence

import numpy as np

from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import JointType
from msgs_config.character.lowest_points import links_in_ground
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order
from msgs_config.shared_parameters import PLANE
from sim_node.physics.engine import UNLIMITED_SPEED
from sim_node.physics.settings import SimulationSettings

_SHORT_LENGTH = 0.1  # m: at 10 m/s such a pendulum turns at Bullet's own bound, 100 rad/s
_LARGEST_TURN = 100.0 / 240.0  # rad or m in an engine step: Bullet's own bound at 240 Hz
_MAX_NAMES = 5  # joints or links in a warning


def short_joints(character: Character) -> list[str]:
    """Names of the hinges that carry a pendulum of less than 10 cm at the rest pose."""
    hinges = [link for link in character.links if link.joint.type is JointType.REVOLUTE]
    if not hinges:
        return []
    model = still_model(character, np.array(character.rest_position))
    inertia = model.inertia_of_entries()
    short = []
    for index, link in enumerate(character.links):
        if link.joint.type is not JointType.REVOLUTE:
            continue
        centre, mass = model.subtree(index)
        origins, axes = model.link_frames(np.array([index]))
        axis = fixed_order.apply(axes[0], np.array(link.joint.axis_in_child))
        across = fixed_order.cross(axis, centre - origins[0])
        moment = mass * math.sqrt(fixed_order.dot(across, across))
        if inertia[character.layout.joint(link.joint.name).start] < _SHORT_LENGTH * moment:
            short.append(link.joint.name)
    return short


def speed_bounds(character: Character, step_s: float, speed_limit: float) -> dict[bool, float]:
    """The largest speed of any degree of freedom at engine steps of `step_s`, rad/s or m/s.

    By whether there is a ground. At most half of `speed_limit`, beyond which a speed counts as
    divergence: where a joint mimics another, the coupling may add to a speed. So by its speed alone
    such a character never diverges.
    """
    bound = _bound(step_s, speed_limit)
    if short_joints(character):
        return {False: bound, True: bound}
    return {False: UNLIMITED_SPEED, True: bound if links_in_ground(character) else UNLIMITED_SPEED}


def _bound(step_s: float, speed_limit: float) -> float:
    return min(_LARGEST_TURN / step_s, 0.5 * speed_limit)


def describe_speed_bound(character: Character, settings: SimulationSettings) -> tuple[str, ...]:
    """Warnings if the settings lead to a bound on the speeds."""
    has_ground = settings.terrain == PLANE
    short, deep = short_joints(character), links_in_ground(character) if has_ground else {}
    if not (short or deep):
        return ()
    step_s = settings.step_s
    bound = _bound(step_s, settings.speed_limit)
    slower = f"no joint and no base is let be faster than {bound:.4g} rad/s or m/s"
    warnings = []
    if deep:
        depths = [f"{name} {depth:.3g} m deep" for name, depth in deep.items()]
        warnings.append(
            f"the fixed base puts links into the ground, which throws them out: {_few(depths)}; "
            f"raise the URDF's first link over it, or set 'terrain' to none; {slower}"
        )
    if short:
        warnings.append(
            f"what these joints carry is so short that an impact turns it faster than engine steps "
            f"of {1e3 * step_s:.3g} ms follow: {_few(short)}; {slower}, substeps raise that"
        )
    return tuple(warnings)


def _few(items: Sequence[str]) -> str:
    """The first ones of a list, and how many more there are."""
    more = f" and {len(items) - _MAX_NAMES} more" if len(items) > _MAX_NAMES else ""
    return ", ".join(items[:_MAX_NAMES]) + more
