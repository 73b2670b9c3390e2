"""What is not as Bullet loads it: masses, damping, a limit on speed, joint motors."""

from collections.abc import Sequence

from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from sim_node.physics.bullet.client import Engine, pybullet


def set_link_dynamics(client: Engine, body: int, friction: float, speed_bound: float) -> None:
    """Switch off the damping of a body's links and joints, and set every link's friction.

    `speed_bound` in rad/s and m/s is that of every degree of freedom, the base's too.
    """
    # One call a setting: a link silently loses some of those that share a call.
    settings = (
        {"linearDamping": 0.0, "angularDamping": 0.0},
        {"jointDamping": 0.0},
        {"lateralFriction": friction},
        {"maxJointVelocity": speed_bound},
    )
    for link in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
        for setting in settings:
            pybullet.changeDynamics(body, link, **setting, physicsClientId=client)


def set_masses(client: Engine, body: int, numbers: Sequence[int], character: Character) -> None:
    """Set mass and inertia of the links that are heavier or lighter than their URDF says.

    `numbers` are the engine's, a link each.
    """
    for link, number in zip(character.links, numbers, strict=True):
        if link.mass_factor != 1.0:
            # The mass first: with it alone the engine makes up an inertia from the shapes.
            for setting in ({"mass": link.mass}, {"localInertiaDiagonal": link.inertia_diagonal}):
                pybullet.changeDynamics(body, number, **setting, physicsClientId=client)


def remove_motors(client: Engine, body: int, joints: Sequence[int], balls: Sequence[int]) -> None:
    """Switch off the motors that hold joints, by the engine's numbers; `balls` are among them."""
    for index in joints:
        pybullet.setJointMotorControl2(
            body,
            index,
            pybullet.POSITION_CONTROL,
            positionGain=0.0,
            targetVelocity=0.0,
            force=0.0,
            physicsClientId=client,
        )
    for index in balls:  # a ball joint has a second default motor
        pybullet.setJointMotorControlMultiDof(
            body,
            index,
            pybullet.POSITION_CONTROL,
            targetPosition=rotations.IDENTITY_XYZW,
            positionGain=0.0,
            velocityGain=1.0,
            force=(0.0, 0.0, 0.0),
            physicsClientId=client,
        )
