"""One character in the engine: its state read and its efforts applied, in URDF link frames.

PyBullet's base pose and velocity, and a ball joint's rotation, velocity and torque, are those of
*inertial* frames. With `o` the orientation of a link's inertial frame in its link frame, a ball
joint's rotation `q` in the engine is `o q o^-1` here, its velocity `w` is `o w`; the base's
orientation `q` in the engine is `q o^-1` here.
"""

from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.bullet import load_urdf, pybullet
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import frames, rotations
from sim_node.physics.links import Links

_UNLIMITED_SPEED = 1e9  # Bullet clamps at 100 otherwise, and a divergence would stay unseen


class Body:
    """A character loaded into an engine. Positions, velocities and efforts are (n,) arrays."""

    def __init__(self, client: int, character: Character, friction: float) -> None:
        self._client = client
        self._layout = character.layout
        self._body = load_urdf(client, character.loading)
        self._floating = self._layout.has_floating_base
        base = character.links[0]
        self._base_offset = base.inertial_pose.position
        self._base_turn = np.array(base.inertial_pose.orientation_xyzw)
        self._base_turn_back: list[float] = rotations.conjugate(self._base_turn).tolist()
        self._find_joints(character)
        self._remove_motors_and_damping(friction)
        if not self._floating:
            pose = base.joint.pose_in_parent
            self._place_base(np.array(pose.position), np.array(pose.orientation_xyzw))

    def _find_joints(self, character: Character) -> None:
        """Where each joint of the layout is in the engine, and its entries in what it returns."""
        count = pybullet.getNumJoints(self._body, physicsClientId=self._client)
        infos = [
            pybullet.getJointInfo(self._body, i, physicsClientId=self._client) for i in range(count)
        ]
        numbers = {info[1].decode(): info[0] for info in infos}
        in_order = [-1, *(numbers[link.joint.name] for link in character.links[1:])]
        self.links = Links(self._client, self._body, character, in_order)
        joints = [j for j in self._layout.joints if j.type is not JointType.FLOATING]
        self._joints = [numbers[joint.name] for joint in joints]
        self._entries = [joint.entries for joint in joints]
        self._balls = [numbers[j.name] for j in joints if j.type is JointType.SPHERICAL]
        turns = {link.joint.name: link.inertial_pose.orientation_xyzw for link in character.links}
        # of each joint; the axes of a ball joint's inertial frame in its link's
        self._axes = [
            frames.axes(turns[joint.name]) if joint.type is JointType.SPHERICAL else None
            for joint in joints
        ]

    def _remove_motors_and_damping(self, friction: float) -> None:
        """Take away what the engine adds of its own, and set the friction."""
        # One call a setting: a link silently loses some of those that share a call.
        settings = (
            {"linearDamping": 0.0, "angularDamping": 0.0},
            {"jointDamping": 0.0},
            {"lateralFriction": friction},
            {"maxJointVelocity": _UNLIMITED_SPEED},
        )
        for link in range(-1, pybullet.getNumJoints(self._body, physicsClientId=self._client)):
            for setting in settings:
                pybullet.changeDynamics(self._body, link, **setting, physicsClientId=self._client)
        for index in self._joints:
            pybullet.setJointMotorControl2(
                self._body,
                index,
                pybullet.POSITION_CONTROL,
                positionGain=0.0,
                targetVelocity=0.0,
                force=0.0,
                physicsClientId=self._client,
            )
        for index in self._balls:  # a ball joint has a second default motor
            pybullet.setJointMotorControlMultiDof(
                self._body,
                index,
                pybullet.POSITION_CONTROL,
                targetPosition=rotations.IDENTITY_XYZW,
                positionGain=0.0,
                velocityGain=1.0,
                force=(0.0, 0.0, 0.0),
                physicsClientId=self._client,
            )

    def read(self) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n,), message form."""
        position: list[float] = []
        velocity: list[float] = []
        if self._floating:
            origin, motion, turn = self._read_base()
            position += (*origin, *frames.rotation_vector(turn))
            velocity += motion
        states: tuple[Any, ...] = ()
        if self._joints:
            states = pybullet.getJointStatesMultiDof(
                self._body, self._joints, physicsClientId=self._client
            )
        for (value, speed, *_), axes in zip(states, self._axes, strict=True):
            if axes is not None:
                value = frames.to_parent(axes, frames.rotation_vector(value))
                speed = frames.to_parent(axes, speed)
            position += value
            velocity += speed
        return np.array(position), np.array(velocity)

    def set_state(self, position: FloatArray, velocity: FloatArray) -> None:
        """Put the character into a state given as `read` gives it."""
        if self._floating:
            self._place_base(position[:3], rotations.exp(position[3:6]))
            self._set_base_velocity(velocity[:3], velocity[3:6])
        for index, entries, axes in zip(self._joints, self._entries, self._axes, strict=True):
            value, speed = position[entries].tolist(), velocity[entries].tolist()
            if axes is not None:
                value = rotations.exp(np.array(frames.to_child(axes, value))).tolist()
                speed = frames.to_child(axes, speed)
            pybullet.resetJointStateMultiDof(
                self._body,
                index,
                targetValue=value,
                targetVelocity=speed,
                physicsClientId=self._client,
            )

    def apply(self, effort: FloatArray) -> None:
        """Apply a generalised effort (n,) during the engine's next step, and only then."""
        values = effort.tolist()
        forces = [
            values[entries] if axes is None else frames.to_child(axes, values[entries])
            for entries, axes in zip(self._entries, self._axes, strict=True)
        ]
        pybullet.setJointMotorControlMultiDofArray(
            self._body,
            self._joints,
            pybullet.TORQUE_CONTROL,
            forces=forces,
            physicsClientId=self._client,
        )
        if self._floating and any(values[:6]):
            self._apply_to_base(effort[:3], effort[3:6])

    def _apply_to_base(self, force: FloatArray, torque_in_base: FloatArray) -> None:
        """Apply a force (N, world) at the base link's origin, and a torque (N m, base frame)."""
        origin, _, axes = self._base_frame()
        pybullet.applyExternalForce(
            self._body, -1, force, origin, pybullet.WORLD_FRAME, physicsClientId=self._client
        )
        torque = frames.to_parent(axes, torque_in_base.tolist())
        pybullet.applyExternalTorque(
            self._body, -1, torque, pybullet.WORLD_FRAME, physicsClientId=self._client
        )

    def _base_frame(self) -> tuple[frames.Triple, frames.Quaternion, frames.Axes]:
        """Origin in m, orientation xyzw and axes of the base link in the world."""
        com, inertial_turn = pybullet.getBasePositionAndOrientation(
            self._body, physicsClientId=self._client
        )
        turn = frames.product(inertial_turn, self._base_turn_back)
        axes = frames.axes(turn)
        x, y, z = frames.to_parent(axes, self._base_offset)
        return (com[0] - x, com[1] - y, com[2] - z), turn, axes

    def _read_base(self) -> tuple[frames.Triple, tuple[float, ...], frames.Quaternion]:
        """Origin, velocity (6,) and orientation xyzw of the floating base, message form."""
        origin, turn, axes = self._base_frame()
        (vx, vy, vz), angular = pybullet.getBaseVelocity(self._body, physicsClientId=self._client)
        angular_in_base = frames.to_child(axes, angular)
        x, y, z = frames.to_parent(axes, frames.cross(angular_in_base, self._base_offset))
        return origin, (vx - x, vy - y, vz - z, *angular_in_base), turn

    def _place_base(self, origin: FloatArray, turn_xyzw: FloatArray) -> None:
        pybullet.resetBasePositionAndOrientation(
            self._body,
            origin + rotations.rotate(turn_xyzw, np.array(self._base_offset)),
            rotations.multiply(turn_xyzw, self._base_turn),
            physicsClientId=self._client,
        )

    def _set_base_velocity(self, linear: FloatArray, angular_in_base: FloatArray) -> None:
        _, _, axes = self._base_frame()
        angular = angular_in_base.tolist()
        pybullet.resetBaseVelocity(
            self._body,
            linear + frames.to_parent(axes, frames.cross(angular, self._base_offset)),
            frames.to_parent(axes, angular),
            physicsClientId=self._client,
        )
