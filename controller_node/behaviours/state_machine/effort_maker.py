"""From targets to efforts: by inverse dynamics on the feet that stand, or by the control law."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from controller_node.behaviours.state_machine import laws
from controller_node.behaviours.state_machine.body import BodyState, in_frame, in_world
from controller_node.behaviours.state_machine.description import (
    BALANCE,
    Machine,
    RootTarget,
    State,
)
from controller_node.behaviours.state_machine.legs.leg import Leg
from controller_node.behaviours.state_machine.pose import TargetPose
from controller_node.behaviours.state_machine.situation import Situation
from controller_node.behaviours.state_machine.support import FootContact, support_effort
from controller_node.control_laws import GainArrays
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.geometry import fixed_order
from msgs_config.geometry.scalars import (
    Vector,
    about_x,
    about_y,
    about_z,
    add,
    conjugate,
    cross,
    dot,
    log,
    multiply,
    norm,
    rotate,
    scale,
    subtract,
    yaw,
)

_SWIVEL = (10.0, 0.5)  # N m/rad and N m s/rad: keeps the knee of a leg that stands above its foot
_LEVEL = (80.0, 0.8)  # N m/rad and N m s/rad: keeps the sole of a leg that stands level
_MIN_ARRIVAL = 0.015  # s until an arrival, at least: errors are not made good within a tick
_LEFT = (0.0, 1.0, 0.0)


class Hold(NamedTuple):
    """How the root is to be held now."""

    root: RootTarget
    ground: float  # m, height of the soles that stand
    rest: float  # s, until it is to have its height and climb, where it arrives


class EffortMaker:
    """Makes efforts of targets; the model is in the present state."""

    def __init__(
        self,
        model: DynamicsModel,
        layout: JointLayout,
        machine: Machine,
        legs: Mapping[str, Leg],
        period: float,  # s
    ) -> None:
        self._model, self._layout, self._machine = model, layout, machine
        self._legs, self._period = legs, period
        self._gains: dict[tuple[str, str], tuple[GainArrays, GainArrays]] = {}

    def gains(self, state: State, stance: str, base: GainArrays) -> GainArrays:
        """The gains of a state's joints: its own, or those of the parameters; none of the root."""
        known = self._gains.get((state.name, stance))
        if known is None or known[0] is not base:
            known = self._gains[state.name, stance] = base, self._make_gains(state, stance, base)
        return known[1]

    def _make_gains(self, state: State, stance: str, base: GainArrays) -> GainArrays:
        stiffness, damping = base.stiffness.copy(), base.damping.copy()
        for name, (p, d) in state.gains.items():
            entries = self._layout.joint(self._machine.joint(name, stance)).entries
            stiffness[entries], damping[entries] = p, d
        for name, effort in state.efforts.items():
            if effort == BALANCE:
                entries = self._layout.joint(self._machine.joint(name, stance)).entries
                stiffness[entries] = damping[entries] = 0.0
        stiffness[:6] = damping[:6] = 0.0
        return GainArrays(stiffness, damping, base.integral, base.effort_limits)

    def supported(
        self,
        state: State,
        at: Situation,
        pose: TargetPose,
        gains: GainArrays,
        contacts: Sequence[FootContact],
        hold: Hold,
    ) -> FloatArray:
        """The effort (n,) by which the body moves as wanted, its feet pressed on the ground.

        Each joint's acceleration is that of implicit PD control against its inertia. Without
        contacts the body falls, and joints move as wanted all the same.
        """
        body = at.body
        acceleration = self._joint_accelerations(pose, body, gains)
        acceleration[:6] = 0.0
        if contacts:
            acceleration[2:6] = self._root_acceleration(hold, at)
        effort = support_effort(
            self._model,
            acceleration,
            contacts,
            state.bounds,
            (body.root, body.root_xyzw),
        )
        for contact in contacts:
            effort[contact.leg.ankle_entries] += self._ankle_effort(
                contact, at.body, at.course.heading
            )
        return self.added(state, at, effort)

    def _joint_accelerations(
        self, pose: TargetPose, body: BodyState, gains: GainArrays
    ) -> FloatArray:
        """Accelerations (n,) of implicit PD control with the diagonal of the mass matrix.

        `(Kp (e + h (vr - v)) + Kd (vr - v)) / (M + Kd h + Kp h^2)`: Tan, Liu and Turk 2011,
        joint by joint.
        """
        period = self._period
        error = self._model.error_of_state(pose.position)
        slower = pose.velocity - body.velocity
        damped = gains.damping + period * gains.stiffness
        inertia = self._model.inertia_of_entries() + period * damped
        accelerations: FloatArray = (
            pose.acceleration + (gains.stiffness * error + damped * slower) / inertia
        )
        return accelerations

    def _root_acceleration(self, hold: Hold, at: Situation) -> FloatArray:
        """Upward acceleration, m/s^2, and angular acceleration in the base frame, rad/s^2: (4,)."""
        body, heading, root = at.body, at.course.heading, hold.root
        above, climb = hold.ground + root.height - body.root[2], float(body.velocity[2])
        if root.arrival > 0.0:
            rest = max(hold.rest, _MIN_ARRIVAL)
            rise = laws.arrival_acceleration(above, climb, root.climb, rest)
        else:
            p, d = root.height_gains
            rise = p * above + d * (root.climb - climb)
        rise += root.thrust / self._model.mass
        error = in_frame(heading, _tilt_error(root, at))
        spin = in_frame(heading, body.spin)
        tilt, turn = root.tilt_gains, root.turn_gains
        angular = (
            tilt[0] * error[0] - tilt[1] * spin[0],
            tilt[0] * error[1] - tilt[1] * spin[1],
            turn[0] * error[2] + turn[1] * (at.course.turn - spin[2]),
        )
        return np.array((rise, *rotate(conjugate(body.root_xyzw), in_world(heading, angular))))

    def _ankle_effort(self, contact: FootContact, body: BodyState, heading: float) -> FloatArray:
        """What an ankle (3,) adds so that the sole is level and the knee above the foot, N m."""
        leg, foot = contact.leg, body.feet[contact.side]
        foot_xyzw = multiply(foot.turn, leg.upright[2])
        hip = leg.hip(body.root, body.root_xyzw)
        ankle = subtract(foot.sole, rotate(foot_xyzw, leg.sole_in_foot))
        along = subtract(ankle, hip)
        along = scale(1.0 / max(norm(along), 1e-9), along)
        thigh = body.turns[leg.thigh_link]
        ahead = rotate(thigh, rotate(conjugate(leg.upright[0]), _LEFT))
        wanted = rotate(about_z(heading), _LEFT)
        jacobian = self._model.link_jacobian(leg.thigh_link)
        spin = fixed_order.apply(jacobian[3:], body.velocity).tolist()
        swivel = _SWIVEL[0] * dot(cross(ahead, wanted), along)
        swivel -= _SWIVEL[1] * dot((spin[0], spin[1], spin[2]), along)
        tilt = log(multiply(about_z(yaw(foot.turn)), conjugate(foot.turn)))
        jacobian = self._model.link_jacobian(leg.foot_link)
        rate = fixed_order.apply(jacobian[3:], body.velocity).tolist()
        (p, d), period = _LEVEL, self._period
        damped = d + period * p
        share = leg.foot_inertia / (leg.foot_inertia + period * damped)
        level = [share * (p * tilt[axis] - damped * rate[axis]) for axis in (0, 1)]
        turn = -share * d * rate[2]
        torque = add((level[0], level[1], turn), scale(-contact.share * swivel, along))
        return np.array(rotate(conjugate(foot_xyzw), torque))

    def added(self, state: State, at: Situation, effort: FloatArray) -> FloatArray:
        """An effort (n,) with what a state's efforts add; the balanced ones are another law's."""
        for name, value in state.efforts.items():
            if not isinstance(value, str):
                entries = self._layout.joint(self._machine.joint(name, at.stance)).entries
                effort[entries] += np.array(value)
        return effort

    def balanced(
        self, state: State, at: Situation, pose: TargetPose, gains: GainArrays
    ) -> FloatArray:
        """The effort (n,) beside that of the law: a stance hip's by SIMBICON's balance of torques.

        `tilt_gains` and `turn_gains` are then N m/rad and N m s/rad.
        """
        effort = np.zeros(self._layout.size)
        if BALANCE in state.efforts.values():
            stance, swing = self._legs[at.stance], self._legs[at.swing]
            torso = self._torso_torque(state.root, at)
            hip = self._pd_torque(swing, pose, at.body, gains)
            torque = [laws.stance_hip_torque(a, b) for a, b in zip(torso, hip, strict=True)]
            thigh = at.body.turns[stance.thigh_link]
            local = rotate(conjugate(thigh), (torque[0], torque[1], torque[2]))
            for name, value in state.efforts.items():
                if value == BALANCE:
                    joint = self._machine.joint(name, at.stance)
                    effort[self._layout.joint(joint).entries] = local
        return self.added(state, at, effort)

    def _torso_torque(self, root: RootTarget, at: Situation) -> Vector:
        """The torque on the torso that holds it as wanted, N m, world axes."""
        error, (x, y, z) = _tilt_error(root, at), at.body.spin
        (p, d), (q, e) = root.tilt_gains, root.turn_gains
        return (p * error[0] - d * x, p * error[1] - d * y, q * error[2] - e * z)

    def _pd_torque(self, leg: Leg, pose: TargetPose, body: BodyState, gains: GainArrays) -> Vector:
        """The torque of PD control on a thigh, N m, world axes."""
        entries = leg.hip_entries
        error = self._model.error_of_state(pose.position)[entries]
        slower = pose.velocity[entries] - body.velocity[entries]
        x, y, z = (gains.stiffness[entries] * error + gains.damping[entries] * slower).tolist()
        return rotate(body.turns[leg.thigh_link], (x, y, z))


def _tilt_error(root: RootTarget, at: Situation) -> Vector:
    """The rotation vector from how the root is turned to how it is to be, world axes, rad."""
    lean = multiply(about_y(root.pitch), about_x(at.mirror * root.roll))
    return log(multiply(multiply(about_z(at.course.heading), lean), conjugate(at.body.tilt)))
