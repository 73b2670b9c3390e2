"""A humanoid that walks by SIMBICON: poses of a state machine, and the student's laws of balance.

Source: Yin, Loken and van de Panne 2007, "SIMBICON: Simple Biped Locomotion Control".
"""

from typing import NamedTuple

import numpy as np

from controller_node.balance import BalanceController
from controller_node.control_laws import stable_pd_effort
from lecture.labs.body import Body
from lecture.labs.simulated import PERIOD
from lecture.labs.student import Student
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from msgs_config.messages.state import StampedState

SIDES = ("right", "left")
_ROOT = 6  # entries of the root, the first ones
_RAIL = (1, 3, 4)  # of them those that a rail holds: aside, roll and yaw


class Gait(NamedTuple):
    """Angles of the two phases of a step, rad: the foot is lifted, then put down."""

    lift_time: float = 0.3  # s
    swing_hip: tuple[float, float] = (0.45, -0.06)  # of the thigh against the vertical, forwards
    swing_knee: tuple[float, float] = (-0.9, -0.07)
    swing_foot: tuple[float, float] = (0.09, 0.1)  # of the foot against the ground, toes up
    stance_knee: tuple[float, float] = (-0.05, -0.05)
    stance_ankle: tuple[float, float] = (0.02, 0.0)
    lean: float = 0.08  # of the pelvis, forwards
    placement: tuple[float, float] = (0.3, 0.18)  # c_d 1/m, c_v s/m
    torso: tuple[float, float] = (115.0, 12.6)  # N m/rad, N m s/rad of the pelvis
    ankle: tuple[float, float] = (134.0, 3.9)  # N m/rad, N m s/rad


GAIT = Gait()


class Walker:
    """The law of one walk: it remembers the state of its machine."""

    def __init__(self, student: Student, body: Body) -> None:
        """Begin with the state 0, in which the right foot is lifted."""
        self._student, self._body = student, body
        layout = body.character.layout
        names = [link.name for link in body.character.links]
        self._entries = {
            joint: layout.joint(joint).entries for joint in layout.actuated_joint_names
        }
        self._links = {name: names.index(name) for name in names}
        self._balance = BalanceController(body.character, body.character.feet)
        self._up = rotations.exp(body.start.position[3:6])
        self._rest = np.array(body.start.position)
        self._stiffness, self._damping = body.stiffness.copy(), body.damping.copy()
        free = [entry for entry in range(_ROOT) if entry not in _RAIL]
        self._stiffness[free] = self._damping[free] = 0.0
        for side in SIDES:
            at = self._entries[f"{side}_ankle"]
            self._stiffness[at], self._damping[at] = GAIT.ankle
        self.state, self._since = 0, 0
        self.steps = 0
        """How often the machine has begun to lift a foot, after the first time."""

    def __call__(self, tick: int, state: StampedState, contacts: FloatArray | None) -> FloatArray:
        """The efforts (n,) of a tick."""
        assert contacts is not None
        model = self._body.model
        model.update(state.position, state.velocity)
        stance = self._leg()
        load = float(contacts[self._links[f"{SIDES[1 - stance]}_ankle"], 2])
        following = self._student.number(
            "next_state", self.state, (tick - self._since) * PERIOD, GAIT.lift_time, load
        )
        if round(following) % 4 != self.state:
            self.state, self._since = round(following) % 4, tick
            self.steps += self.state % 2 == 0
            stance = self._leg()
        return self._efforts(state, SIDES[stance], SIDES[1 - stance])

    def _leg(self) -> int:
        return min(max(round(self._student.number("stance_leg", self.state)), 0), 1)

    def _efforts(self, state: StampedState, stance: str, swing: str) -> FloatArray:
        model, entries, phase = self._body.model, self._entries, self.state % 2
        _, turns = model.link_poses()
        base = turns[0]
        upright = rotations.multiply(self._up, _forwards(-GAIT.lean))
        target = self._rest.copy()
        target[[0, 2]] = state.position[[0, 2]]
        thigh = self._thigh(stance, phase)
        target[entries[f"{swing}_hip"]] = _relative(base, thigh)
        target[entries[f"{swing}_knee"]] = GAIT.swing_knee[phase]
        foot = rotations.multiply(self._up, _forwards(GAIT.swing_foot[phase]))
        target[entries[f"{swing}_ankle"]] = _relative(turns[self._links[f"{swing}_knee"]], foot)
        target[entries[f"{stance}_knee"]] = GAIT.stance_knee[phase]
        target[entries[f"{stance}_ankle"]] = (0.0, 0.0, GAIT.stance_ankle[phase])
        stiffness, damping = self._stiffness.copy(), self._damping.copy()
        hip = entries[f"{stance}_hip"]
        stiffness[hip] = damping[hip] = 0.0
        gains = (stiffness, damping, model.error_of_state(target), state.velocity)
        effort = stable_pd_effort(model, *gains, np.zeros(len(target)), PERIOD)
        effort[[0, 2, 5]] = 0.0
        swing_turn, stance_turn = (turns[self._links[f"{each}_hip"]] for each in (swing, stance))
        torso = self._student.call(
            "torso_torque",
            rotations.rotate(base, _relative(base, upright)),
            rotations.rotate(base, state.velocity[3:6]),
            *GAIT.torso,
            shape=(3,),
        )
        swinging = rotations.rotate(swing_turn, effort[entries[f"{swing}_hip"]])
        torque = self._student.call("stance_hip_torque", torso, swinging, shape=(3,))
        effort[hip] = rotations.rotate(rotations.conjugate(stance_turn), torque)
        return effort

    def _thigh(self, stance: str, phase: int) -> FloatArray:
        """The swing thigh's desired turn (4,) in the world."""
        model = self._body.model
        foot = self._body.character.feet.index(f"{stance}_ankle")
        place = self._balance.soles(model).points[foot]
        angle = self._student.number(
            "foot_placement",
            GAIT.swing_hip[phase],
            *GAIT.placement,
            float(model.centre_of_mass()[0] - place[0]),
            float(model.centre_of_mass_velocity()[0]),
        )
        return rotations.multiply(self._up, _forwards(angle))


def _forwards(angle: float) -> FloatArray:
    """The turn (4,) by which a link that hangs is swung forwards: about its z, to the right."""
    return rotations.exp(np.array((0.0, 0.0, angle)))


def _relative(parent: FloatArray, child: FloatArray) -> FloatArray:
    """The rotation vector (3,) of a child's turn in its parent's frame; both are in the world."""
    return rotations.log(rotations.multiply(rotations.conjugate(parent), child))
