"""The plane z = 0 in the engine: a plane, and for links with flat soles a box below it.

Against a plane the engine finds one point of contact a step, the deepest corner of a box, and drops
it as soon as it slides. A sole then turns over one corner after the other, faster than they are
found, and sinks in: a walk's feet by 12 mm in the mean. Between two boxes it finds all corners that
touch, at each step. What is round has one point of contact, for which a plane is all it takes.
"""

from collections.abc import Sequence

from msgs_config.character.model import Character, ShapeType
from sim_node.physics.bullet.client import Engine, pybullet

# m: farther than anything walks, and so deep that nothing comes out below it.
_HALF_EXTENTS = (1e6, 1e6, 100.0)
_BASE = -1  # the engine's number of a body's first link

# Two bodies may touch if each one's mask has the other's group: those of the engine, and one more.
_DYNAMIC, _STATIC, _FLAT = 1, 2, 64
_ALL = -1
_BOTH_MASKS = 0  # the engine's number of that rule; without it one mask of the two would do


def add_ground(client: Engine, friction: float) -> None:
    """Put the ground into a world that is empty; a link will touch one of its two bodies."""
    pybullet.setPhysicsEngineParameter(collisionFilterMode=_BOTH_MASKS, physicsClientId=client)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    # With a frame of its own it is a compound to the engine, which then drops the contacts of what
    # has parted; it would keep those of a mere box, and find new ones too late.
    box = pybullet.createCollisionShape(
        pybullet.GEOM_BOX,
        halfExtents=_HALF_EXTENTS,
        collisionFramePosition=(0.0, 0.0, -_HALF_EXTENTS[2]),
        physicsClientId=client,
    )
    for shape, touched_by in ((plane, _DYNAMIC), (box, _FLAT)):
        body = pybullet.createMultiBody(0.0, shape, physicsClientId=client)
        _set_group(client, body, _BASE, _STATIC, touched_by)
        set_friction(client, body, friction)


def choose_ground(client: Engine, body: int, numbers: Sequence[int], character: Character) -> None:
    """Have the links of a body that are boxes touch the box, and all others the plane.

    `numbers` are the engine's, a link each. It is for a body that was just loaded: the engine
    forgets what touches it.
    """
    for number, link in zip(numbers, character.links, strict=True):
        is_fixed = number == _BASE and character.loading.fixed_base
        if not is_fixed and any(shape.type is ShapeType.BOX for shape in link.collision_shapes):
            touch_as_box(client, body, number)


def touch_as_box(client: Engine, body: int, link: int = _BASE) -> None:
    """Have a link of a body touch the ground's box in place of the plane; see `choose_ground`."""
    _set_group(client, body, link, _FLAT, _ALL)


def _set_group(client: Engine, body: int, link: int, group: int, mask: int) -> None:
    pybullet.setCollisionFilterGroupMask(body, link, group, mask, physicsClientId=client)


def set_friction(client: Engine, body: int, friction: float) -> None:
    """Set the friction of all links of a body that does not move."""
    for link in range(_BASE, pybullet.getNumJoints(body, physicsClientId=client)):
        pybullet.changeDynamics(body, link, lateralFriction=friction, physicsClientId=client)
