"""The controller's model of the dynamics: MuJoCo behind one class."""

import mujoco
import numpy as np

from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.character import Character, Joint, Link
from msgs_config.joint_layout import Configuration, JointType

_GRAVITY = 9.81
_WXYZ = (3, 0, 1, 2)  # MuJoCo's order of a quaternion's components

_MUJOCO_TYPES = {
    JointType.REVOLUTE: mujoco.mjtJoint.mjJNT_HINGE,
    JointType.PRISMATIC: mujoco.mjtJoint.mjJNT_SLIDE,
    JointType.SPHERICAL: mujoco.mjtJoint.mjJNT_BALL,
    JointType.FLOATING: mujoco.mjtJoint.mjJNT_FREE,
}


class DynamicsModel:
    """Mass matrix `M` and bias force `C` of `M dv/dt + C = f`, in the layout's coordinates.

    MuJoCo's velocities and forces are the layout's own; only its positions differ, in that a
    rotation is a quaternion (wxyz) there.
    """

    def __init__(self, character: Character, gravity: float = _GRAVITY) -> None:
        """Build the model of a character under a gravity in m/s^2 along -z."""
        self._layout = character.layout
        self._model = _compile(character, gravity)
        self._data = mujoco.MjData(self._model)
        self._mass_matrix = np.zeros((self._layout.size, self._layout.size))
        self._damping = character.passive_damping()
        # M is stored by rows of its lower triangle, the diagonal last
        self._diagonal = self._model.M_rowadr + self._model.M_rownnz - 1
        address = self._model.jnt_qposadr
        types = [joint.type for joint in self._layout.joints]
        rotation_offset = {JointType.SPHERICAL: 0, JointType.FLOATING: 3}
        rotation_starts = [
            start + rotation_offset[joint_type]
            for start, joint_type in zip(address, types, strict=True)
            if joint_type in rotation_offset
        ]
        self._quaternion_entries = np.array(rotation_starts, dtype=np.intp).reshape(-1, 1) + range(
            4
        )
        rotation_vectors = self._layout.rotation_entries.ravel()
        self._scalar_dofs = np.setdiff1d(np.arange(self._layout.size), rotation_vectors)
        quaternions = self._quaternion_entries.ravel()
        self._scalar_entries = np.setdiff1d(np.arange(self._model.nq), quaternions)

    def update(self, configuration: Configuration, velocity: FloatArray) -> None:
        """Take over a state; velocity (n,)."""
        data = self._data
        data.qpos[self._scalar_entries] = configuration.position[self._scalar_dofs]
        data.qpos[self._quaternion_entries] = configuration.orientations_xyzw[:, _WXYZ]
        data.qvel[:] = velocity
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_crb(self._model, data)
        mujoco.mj_comVel(self._model, data)

    def mass_matrix(self) -> FloatArray:
        """The mass matrix M (n, n) at the state taken over: kg, kg m, kg m^2."""
        mujoco.mj_fullM(self._model, self._data, self._mass_matrix)
        return self._mass_matrix.copy()

    def solve(self, force: FloatArray, added: FloatArray, period: float) -> FloatArray:
        """The acceleration `a` (n,) of `(M + D h + diag(added)) a = force` over a period h in s.

        The passive damping D is then that of the velocity at the period's end. The factorisation
        `L' D L` follows the tree of the links (Featherstone 2008, section 6.5), and uses no BLAS.
        """
        data, diagonal = self._data, self._diagonal
        without = data.M[diagonal]
        data.M[diagonal] = without + (period * self._damping + added)
        mujoco.mj_factorM(self._model, data)
        data.M[diagonal] = without
        acceleration: FloatArray = np.empty(self._layout.size)
        mujoco.mj_solveM(self._model, data, acceleration[np.newaxis], force[np.newaxis])
        return acceleration

    def bias_force(self) -> FloatArray:
        """The bias force C (n,) at the state taken over.

        Coriolis, centrifugal and gravity, and what the joints' passive damping takes.
        """
        bias = np.zeros(self._layout.size)
        mujoco.mj_rne(self._model, self._data, 0, bias)
        bias += self._damping * self._data.qvel
        return bias

    def inverse_dynamics(self, acceleration: FloatArray) -> FloatArray:
        """The effort (n,) of an acceleration (n,) in the state taken over: `M dv/dt + C`."""
        effort = np.empty(self._layout.size)
        self._data.qacc[:] = acceleration
        mujoco.mj_rne(self._model, self._data, 1, effort)
        effort += self._damping * self._data.qvel
        return effort

    def gravity_force(self) -> FloatArray:
        """The part of the bias force that is gravity's (n,): the effort that holds it still."""
        data = self._data
        velocity = data.qvel.copy()
        data.qvel[:] = 0.0
        mujoco.mj_comVel(self._model, data)
        force = np.empty(self._layout.size)
        mujoco.mj_rne(self._model, data, 0, force)
        data.qvel[:] = velocity
        mujoco.mj_comVel(self._model, data)
        return force

    def kinetic_energy(self) -> float:
        """Kinetic energy of the state taken over, J."""
        velocity = self._data.qvel
        return float(0.5 * velocity @ self.mass_matrix() @ velocity)

    def link_poses(self) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m, quaternions xyzw (links, 4) of the link frames in the world."""
        return self._data.xpos[1:].copy(), rotations.xyzw_from_wxyz(self._data.xquat[1:])


def _compile(character: Character, gravity: float) -> mujoco.MjModel:
    """MuJoCo's model of a character, its bodies in the order of the character's links."""
    spec = mujoco.MjSpec()
    spec.option.gravity = (0.0, 0.0, -gravity)
    spec.compiler.balanceinertia = False
    bodies = [spec.worldbody]
    for link in character.links:
        bodies.append(_add_body(bodies[link.parent + 1], link))
    model = spec.compile()
    # set afterwards: the compiler refuses a link with mass but without inertia, which is sound
    # wherever the joints above it cannot turn it about its centre of mass alone
    model.body_inertia[1:] = [link.inertia_diagonal for link in character.links]
    model.dof_simplenum[:] = 0  # else a simple body's mass matrix is the one compiled
    return model


def _add_body(parent: mujoco.MjsBody, link: Link) -> mujoco.MjsBody:
    pose, inertial = link.joint.pose_in_parent, link.inertial_pose
    body = parent.add_body(
        name=link.name,
        pos=pose.position,
        quat=rotations.wxyz_from_xyzw(np.array(pose.orientation_xyzw)),
        mass=link.mass,
        ipos=inertial.position,
        iquat=rotations.wxyz_from_xyzw(np.array(inertial.orientation_xyzw)),
        inertia=(1.0, 1.0, 1.0),
        explicitinertial=True,
    )
    if link.joint.type is not JointType.FIXED:
        _add_joint(body, link.joint)
    return body


def _add_joint(body: mujoco.MjsBody, joint: Joint) -> None:
    axis = joint.axis_in_child if any(joint.axis_in_child) else (0.0, 0.0, 1.0)
    body.add_joint(name=joint.name, type=_MUJOCO_TYPES[joint.type], axis=axis)
