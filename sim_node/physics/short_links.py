"""The largest speed of a character whose links are so short that an engine step is long for them.

What a hinge carries swings as a pendulum of the length `l = I / (m r)`, with its inertia I and its
mass m, whose centre is r off the axis (Huygens 1673). Where its holder is stopped at a speed v it
goes on with `v / l`: a finger of 2 cm, at 5 m/s, with 250 rad/s, a radian in a step of 1/240 s. An
engine that takes mass matrix and Coriolis forces from the beginning of a step cannot follow that;
in a chain of such links the energy grows from step to step. Neither their mass nor limits alter
it: fingers of 4 g and of 400 g do the same, with limits and without. So the engine keeps a bound on
the speeds of such a character, as it does by itself in all others: Bullet's own at 240 Hz.
"""

import math

import numpy as np

from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order
from msgs_config.parameters import Values
from sim_node.physics.engine_defaults import UNLIMITED_SPEED

_SHORT = 0.1  # m, of a pendulum that 10 m/s turn by a bound of Bullet's own at 240 Hz
_LARGEST_TURN = 100.0 / 240.0  # rad or m in an engine step
_NAMED = 5  # joints in a warning


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
        if inertia[character.layout.joint(link.joint.name).start] < _SHORT * moment:
            short.append(link.joint.name)
    return short


def speed_bound(character: Character, step_s: float, speed_limit: float) -> float:
    """The largest speed of any degree of freedom at engine steps of `step_s`, rad/s or m/s.

    At most half of `speed_limit`, beyond which a speed counts as divergence: where a joint mimics
    another, the coupling may add to a speed. So by its speed alone such a character never diverges.
    """
    return (
        min(_LARGEST_TURN / step_s, 0.5 * speed_limit)
        if short_joints(character)
        else UNLIMITED_SPEED
    )


def describe_speed_bound(character: Character, values: Values) -> tuple[str, ...]:
    """A warning if the parameters' values of `sim_node` lead to a bound on the speeds."""
    short = short_joints(character)
    if not short:
        return ()
    step_s = 1.0 / (values.integer("rate") * values.integer("substeps"))
    bound = speed_bound(character, step_s, values.number("speed_limit"))
    more = f" and {len(short) - _NAMED} more" if len(short) > _NAMED else ""
    return (
        f"what these joints carry is so short that an impact turns it faster than engine steps of "
        f"{1e3 * step_s:.3g} ms follow: {', '.join(short[:_NAMED])}{more}; no joint and no base is "
        f"let be faster than {bound:.4g} rad/s or m/s, substeps raise that",
    )
