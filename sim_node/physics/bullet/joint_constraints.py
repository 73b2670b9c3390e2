"""What the engine's solver does at joints, with contacts and limits: friction, and coupling.

Both are rows of its velocity solve (Catto 2005, "Iterative Dynamics with Temporal Coherence").
Coulomb friction drives a joint's velocity to zero by an impulse of at most `h F` a step h: it
sticks below F, and slides against F. A coupling `q_f = a q_l + b` is `v_f - a v_l = -c (q_f - a q_l
- b) / h`; its impulse f at the follower is `-a f` at the leader, by virtual work.

The solver is iterative, and a hand of light links far from what its iterations reach. So what does
not depend on contacts is solved beforehand (`joint_resistance`).
"""

from collections.abc import Mapping, Sequence

from msgs_config.character.model import Character
from sim_node.physics.bullet.client import Engine, pybullet
from sim_node.physics.joint_resistance import COUPLING_CORRECTION

_NO_LIMIT = 1e9  # N m or N: the force of a coupling is not limited
_ENGINE_CORRECTION = 0.2  # share of a limit's or contact's excess that an engine step corrects


def set_friction(
    client: Engine, body: int, joints: Sequence[int], friction: Sequence[float]
) -> None:
    """Set the friction of joints, by the engine's numbers, until it is set again; N m or N."""
    pybullet.setJointMotorControlArray(
        body,
        joints,
        pybullet.VELOCITY_CONTROL,
        targetVelocities=[0.0] * len(joints),
        forces=friction,
        physicsClientId=client,
    )


def couple_joints(
    client: Engine, body: int, character: Character, numbers: Mapping[str, int]
) -> None:
    """Couple a body's followers to their leaders.

    `numbers` are the engine's, by the joints' names.
    """
    for joint in character.moving_joints:
        if joint.mimic is not None:
            gear = pybullet.createConstraint(
                body,
                numbers[joint.name],
                body,
                numbers[joint.mimic.leader],
                pybullet.JOINT_GEAR,
                (0.0, 0.0, 1.0),
                (0.0, 0.0, 0.0),
                (0.0, 0.0, 0.0),
                physicsClientId=client,
            )
            pybullet.changeConstraint(
                gear,
                gearRatio=-joint.mimic.multiplier,
                relativePositionTarget=joint.mimic.offset,
                erp=COUPLING_CORRECTION / _ENGINE_CORRECTION,
                maxForce=_NO_LIMIT,
                physicsClientId=client,
            )
