"""One character in the engine: states and forces of its joints and links, in URDF link frames.

PyBullet's base pose and velocity, and a ball joint's rotation, velocity and torque, are those of
*inertial* frames. With `o` the orientation of a link's inertial frame in its link frame, a ball
joint's rotation `q` in the engine is `o q o^-1` here, its velocity `w` is `o w`; the base's
orientation `q` in the engine is `q o^-1` here.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeAlias

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Pose
from msgs_config.geometry import fixed_order, rotations, scalars
from sim_node.physics.bullet.balls import BulletBalls
from sim_node.physics.bullet.client import Engine, load_urdf, pybullet
from sim_node.physics.bullet.defaults import remove_motors, set_link_dynamics, set_masses
from sim_node.physics.bullet.ground import choose_ground
from sim_node.physics.bullet.joint_constraints import couple_joints, set_friction
from sim_node.physics.bullet.loaded_links import check_links
from sim_node.physics.bullet.touches import TouchedLinks, net_wrenches

_QUATERNION = 4  # numbers of a ball joint's position in the engine
_SEARCH_DISTANCE = 1e3  # m, beyond which the engine need not look for what is near


BaseFrame: TypeAlias = tuple[scalars.Vector, scalars.Quaternion, scalars.Axes]
"""Origin in m, orientation xyzw and axes of a base link in the world."""


class BulletBody:
    """A character loaded into an engine.

    Positions, velocities and efforts are (n,) arrays in message form; arrays of links have one row
    a link, in the order of `Character.links`.
    """

    has_armature = False

    def __init__(
        self,
        client: Engine,
        character: Character,
        *,
        friction: float,
        speed_bound: float,
        touched: Callable[[], TouchedLinks],
        balls: BulletBalls,
    ) -> None:
        """Load the character.

        `friction` is that of every link, `speed_bound` in rad/s and m/s that of every degree of
        freedom; `touched` says what touched in the world's last step, whose balls are `balls`.

        Raises:
            CharacterError: the engine refuses the URDF or a mesh, or reads a link otherwise.
        """
        self._client, self._touched, self._ball_bodies = client, touched, balls
        self._layout, self._armature = character.layout, character.armature()
        self._body = load_urdf(client, character.loading)
        self._floating = self._layout.has_floating_base
        poses = [link.inertial_pose for link in character.links]
        self._offsets = np.array([pose.position for pose in poses])
        turns = np.array([pose.orientation_xyzw for pose in poses])
        self._turns_back = rotations.conjugate(turns)
        self._base_offset = poses[0].position
        self._base_turn = turns[0]
        self._base_is_inertial = poses[0] == Pose()
        self._base_turn_back: list[float] = self._turns_back[0].tolist()
        self._base_read: BaseFrame | None = None  # None: not read since the engine's last step
        self._base_centre: scalars.Vector | None = None  # the base's centre of mass; None: unread
        self._find_joints(character)
        choose_ground(client, self._body, self._numbers, character)
        set_link_dynamics(client, self._body, friction, speed_bound)
        pairs = zip(self._joints, self._axes, strict=True)
        ball_joints = [number for number, axes in pairs if axes is not None]
        remove_motors(client, self._body, self._joints, ball_joints)
        names = [j.name for j in self._layout.joints if j.type is not JointType.FLOATING]
        numbers = dict(zip(names, self._joints, strict=True))
        rubbing = [joint.name for joint in character.moving_joints if joint.friction]
        self._rubbing = [numbers[name] for name in rubbing]
        self._rubbing_entries = [self._layout.joint(name).start for name in rubbing]
        couple_joints(client, self._body, character, numbers)
        if not self._floating:
            pose = character.links[0].joint.pose_in_parent
            self._place_base(np.array(pose.position), np.array(pose.orientation_xyzw))

    def _find_joints(self, character: Character) -> None:
        """Find each link and joint in the engine, and the entries of each joint."""
        count = pybullet.getNumJoints(self._body, physicsClientId=self._client)
        infos = [
            pybullet.getJointInfo(self._body, i, physicsClientId=self._client) for i in range(count)
        ]
        numbers = {info[1].decode(): info[0] for info in infos}
        # the engine's number of each link; -1 is the base
        self._numbers = [-1, *(numbers[link.joint.name] for link in character.links[1:])]
        set_masses(self._client, self._body, self._numbers, character)
        check_links(self._client, self._body, self._numbers, character)
        self._row = {number: row for row, number in enumerate(self._numbers)}
        joints = [j for j in self._layout.joints if j.type is not JointType.FLOATING]
        self._joints = [numbers[joint.name] for joint in joints]
        self._entries = [joint.entries for joint in joints]
        turns = {link.joint.name: link.inertial_pose.orientation_xyzw for link in character.links}
        # Of each ball joint the axes of its link's inertial frame in the link; None of others.
        self._axes = [
            scalars.axes(turns[joint.name]) if joint.type is JointType.SPHERICAL else None
            for joint in joints
        ]
        pairs = zip(self._entries, self._axes, strict=True)
        self._balls = [(entries, axes) for entries, axes in pairs if axes is not None]
        # Those whose inertial frame is turned; the others' axes alter only the sign of zeros.
        self._turned = [ball for ball in self._balls if ball[1] != scalars.NO_TURN]

    def read(self) -> FloatArray:
        """Position and velocity, (2, n)."""
        position: list[float] = []
        velocity: list[float] = []
        if self._floating:
            origin, motion, turn = self._read_base()
            position += origin
            position += scalars.log(turn)
            velocity += motion
        if self._joints:
            states = pybullet.getJointStatesMultiDof(
                self._body, self._joints, physicsClientId=self._client
            )
            rotation_vector = scalars.log  # looked up once, not at each joint
            for value, speed, _, _ in states:
                position += rotation_vector(value) if len(value) == _QUATERNION else value
                velocity += speed
        for entries, axes in self._turned if all(position) and all(velocity) else self._balls:
            position[entries] = scalars.to_parent(axes, position[entries])
            velocity[entries] = scalars.to_parent(axes, velocity[entries])
        both = position + velocity
        return np.fromiter(both, float, len(both)).reshape(2, -1)

    def set_state(self, position: FloatArray, velocity: FloatArray) -> None:
        """Put the character into a state given as `read` gives it."""
        self.forget_reading()
        with self._client.alone():
            if self._floating:
                self._place_base(position[:3], rotations.exp(position[3:6]))
                self._set_base_velocity(velocity[:3], velocity[3:6])
            for index, value, speed in self._engine_motion(position, velocity):
                pybullet.resetJointStateMultiDof(
                    self._body,
                    index,
                    targetValue=value,
                    targetVelocity=speed,
                    physicsClientId=self._client,
                )

    def _engine_motion(
        self, position: FloatArray, velocity: FloatArray
    ) -> Iterator[tuple[int, Sequence[float], Sequence[float]]]:
        """The engine's number of each joint, its position and its velocity there."""
        for index, entries, axes in zip(self._joints, self._entries, self._axes, strict=True):
            value, speed = position[entries].tolist(), velocity[entries].tolist()
            if axes is not None:
                value = rotations.exp(np.array(scalars.to_child(axes, value))).tolist()
                speed = scalars.to_child(axes, speed)
            yield index, value, speed

    def set_motion(self, position: FloatArray, velocity: FloatArray) -> None:
        """Set the joints' positions and all velocities, as of `set_state`; the base stays."""
        motion = list(self._engine_motion(position, velocity))
        with self._client.alone():
            if self._floating:
                self._set_base_velocity(velocity[:3], velocity[3:6])
            pybullet.resetJointStatesMultiDof(  # takes lists only: tuples crash it
                self._body,
                [index for index, _, _ in motion],
                targetValues=[value for _, value, _ in motion],
                targetVelocities=[speed for _, _, speed in motion],
                physicsClientId=self._client,
            )

    def forget_reading(self) -> None:
        """Forget what was read last: the engine's state is set to another one."""
        self._base_read = self._base_centre = None

    def apply(self, effort: FloatArray) -> None:
        """Apply a generalised effort (n,) during the engine's next step, and only then."""
        values = effort.tolist()
        for entries, axes in self._turned:
            values[entries] = scalars.to_child(axes, values[entries])
        forces = [values[entries] for entries in self._entries]
        pybullet.setJointMotorControlMultiDofArray(
            self._body,
            self._joints,
            pybullet.TORQUE_CONTROL,
            forces=forces,
            physicsClientId=self._client,
        )
        if self._floating and any(values[:6]):
            self._apply_to_base(values[:3], values[3:6])
        self._centre_at_step = self._base_centre or self._base_pose()[0]
        self._base_read = None  # the engine's next step moves the base
        if self._floating:
            self._base_centre = None

    def set_friction(self, friction: FloatArray) -> None:
        """Set the friction (n,) that joints oppose to contacts in the engine's next step."""
        if self._rubbing:
            values = friction[self._rubbing_entries].tolist()
            set_friction(self._client, self._body, self._rubbing, values)

    def _apply_to_base(self, force: Sequence[float], torque_in_base: Sequence[float]) -> None:
        """Apply a force (N, world) at the base link's origin, and a torque (N m, base frame)."""
        origin, _, axes = self._base_read or self._base_frame()
        pybullet.applyExternalForce(
            self._body, -1, force, origin, pybullet.WORLD_FRAME, physicsClientId=self._client
        )
        torque = scalars.to_parent(axes, torque_in_base)
        pybullet.applyExternalTorque(
            self._body, -1, torque, pybullet.WORLD_FRAME, physicsClientId=self._client
        )

    def base_frame(self) -> tuple[FloatArray, FloatArray]:
        """Origin (3,) in m and orientation xyzw (4,) of the base link in the world."""
        origin, turn, _ = self._base_read or self._base_frame()
        return np.array(origin), np.array(turn)

    def link_frames(self) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m and orientations xyzw (links, 4) of the links in the world."""
        states = self._link_states()
        centres = np.array([state[0] for state in states])
        turns = rotations.multiply(np.array([state[1] for state in states]), self._turns_back)
        return centres - rotations.rotate(turns, self._offsets), turns

    def centres(self) -> list[Sequence[float]]:
        """Centres of mass (links, 3) in the world, m; plain numbers, of which few are used."""
        return [state[0] for state in self._link_states()]

    def centres_at_step(self) -> list[Sequence[float]]:
        """Centres of mass (links, 3) in the world when the engine's last step began, m.

        To be asked for before `link_frames` and `centres`: the engine keeps those of its moving
        links from where its step begins until it is asked where they are now.
        """
        moving = self._numbers[1:]
        if not moving:
            return [self._centre_at_step]
        states = pybullet.getLinkStates(
            self._body, moving, 0, computeForwardKinematics=0, physicsClientId=self._client
        )
        return [self._centre_at_step, *(state[0] for state in states)]

    def kinetic_energy(self) -> float:
        """Kinetic energy of links and rotors, J, by the engine's masses, inertia and velocities."""
        velocity = self.read()[1]
        energy = 0.5 * float(fixed_order.dot(self._armature * velocity, velocity))
        for number, state in zip(self._numbers, self._link_states(velocities=True), strict=True):
            _, turn, *_, linear, angular = map(np.array, state)
            mass, _, inertia, *_ = pybullet.getDynamicsInfo(
                self._body, number, physicsClientId=self._client
            )
            # Angular velocity about the principal axes, rad/s.
            spin = rotations.rotate(rotations.conjugate(turn), angular)
            moving = mass * fixed_order.dot(linear, linear)
            energy += 0.5 * float(moving + fixed_order.dot(spin * spin, np.array(inertia)))
        return energy

    def push(self, pushes: Iterable[tuple[int, FloatArray, FloatArray]]) -> None:
        """Push links during the engine's next step, and only then.

        Of each push: the link's row, its wrench (6,) in N and N m, world axes, and the point (3,)
        in m, link frame, at which the force acts; that adds the torque `r x f` about the centre of
        mass.
        """
        origins, turns = self.link_frames()
        world = {"flags": pybullet.WORLD_FRAME, "physicsClientId": self._client}
        for row, wrench, point in pushes:
            number, at = self._numbers[row], origins[row] + rotations.rotate(turns[row], point)
            pybullet.applyExternalForce(self._body, number, wrench[:3], at, **world)
            pybullet.applyExternalTorque(self._body, number, wrench[3:], **world)

    def contact_wrenches(self) -> tuple[FloatArray, BoolArray]:
        """Net contact wrenches (links, 6) of the last step; which links touched: `net_wrenches`."""
        touches = self._touched().get(self._body, ())
        return net_wrenches(touches, self._row, self.centres_at_step())

    def gaps(self, ball: int) -> FloatArray:
        """Distance (links,) of each link's surface to a ball's, m; inf where there is none.

        `ball` is its place in the order of throws.
        """
        other = self._ball_bodies.numbers[ball]
        gaps = np.full(len(self._numbers), np.inf)
        for point in pybullet.getClosestPoints(
            self._body, other, distance=_SEARCH_DISTANCE, physicsClientId=self._client
        ):
            row, distance = self._row[point[3]], point[8]
            gaps[row] = min(gaps[row], distance)
        return gaps

    def _link_states(self, *, velocities: bool = False) -> Sequence[tuple[Sequence[float], ...]]:
        """Of each link the inertial frame's centre and orientation, and at the end its velocities.

        Velocities are linear (m/s) and angular (rad/s, world) ones, about the centre.
        """
        body, client = self._body, self._client
        base = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        if velocities:
            base += pybullet.getBaseVelocity(body, physicsClientId=client)
        moving = self._numbers[1:]
        if not moving:
            return (base,)
        states = pybullet.getLinkStates(
            body, moving, int(velocities), computeForwardKinematics=1, physicsClientId=client
        )
        return (base, *states)

    def _base_frame(self) -> BaseFrame:
        com, inertial_turn = self._base_pose()
        if self._base_is_inertial and all(com) and all(inertial_turn):
            return com, inertial_turn, scalars.axes(inertial_turn)
        turn = scalars.multiply(inertial_turn, self._base_turn_back)
        axes = scalars.axes(turn)
        x, y, z = scalars.to_parent(axes, self._base_offset)
        return (com[0] - x, com[1] - y, com[2] - z), turn, axes

    def _base_pose(self) -> tuple[scalars.Vector, scalars.Quaternion]:
        """Centre of mass in m and orientation xyzw of the base's inertial frame in the world."""
        pose: tuple[scalars.Vector, scalars.Quaternion]
        pose = pybullet.getBasePositionAndOrientation(self._body, physicsClientId=self._client)
        self._base_centre = pose[0]
        return pose

    def _read_base(self) -> tuple[scalars.Vector, tuple[float, ...], scalars.Quaternion]:
        """Origin, velocity (6,) and orientation xyzw of the floating base, message form."""
        self._base_read = origin, turn, axes = self._base_frame()
        linear, angular = pybullet.getBaseVelocity(self._body, physicsClientId=self._client)
        angular_in_base = scalars.to_child(axes, angular)
        if self._base_is_inertial and all(linear):
            return origin, (*linear, *angular_in_base), turn
        vx, vy, vz = linear
        x, y, z = scalars.to_parent(axes, scalars.cross(angular_in_base, self._base_offset))
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
            linear + scalars.to_parent(axes, scalars.cross(angular, self._base_offset)),
            scalars.to_parent(axes, angular),
            physicsClientId=self._client,
        )
