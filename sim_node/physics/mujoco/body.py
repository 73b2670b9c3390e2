"""One character in MuJoCo's world.

MuJoCo's velocities and forces are those of the message form; only its positions differ, in that a
rotation is a quaternion (wxyz) there.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.compiled.message_form import Places, read_motion
from msgs_config.geometry import fixed_order, rotations
from sim_node.physics.mujoco.part import Part

if TYPE_CHECKING:
    from sim_node.physics.mujoco.world import MujocoWorld

_SEARCH_DISTANCE = 1e3  # m, beyond which MuJoCo need not look for what is near
_NO_TURN_WXYZ = [1.0, 0.0, 0.0, 0.0]


class MujocoBody(Part):
    """A character in a world."""

    has_armature = True

    def __init__(self, world: "MujocoWorld", character: Character, speed_bound: float) -> None:
        super().__init__(character.links)
        self._world, self.character, self.speed_bound = world, character, speed_bound
        self._has_friction = any(joint.friction for joint in character.moving_joints)
        self._identity: list[float] = []  # MuJoCo's position that is no position at all
        quaternions: list[int] = []  # see `Places`
        vectors: list[int] = []
        numbers: list[int] = []
        entries: list[int] = []
        for joint in self._layout.joints:
            if joint.type is not JointType.SPHERICAL:
                count = 3 if joint.type is JointType.FLOATING else 1
                numbers += range(len(self._identity), len(self._identity) + count)
                entries += range(joint.start, joint.start + count)
                self._identity += count * [0.0]
            if joint.rotation is not None:
                quaternions.append(len(self._identity))
                vectors.append(joint.rotation.start)
                self._identity += _NO_TURN_WXYZ
        self.places = Places(
            *(np.array(each, dtype=np.intp) for each in (quaternions, vectors, numbers, entries))
        )

    def read(self) -> FloatArray:
        """Position and velocity, (2, n)."""
        data, place = self._world.data, self.place
        return read_motion(data.qpos[place.positions], data.qvel[place.velocities], *self.places)

    def set_state(self, position: FloatArray, velocity: FloatArray) -> None:
        """Put the character into a state given as `read` gives it."""
        data = self._world.data
        data.qpos[self.place.positions] = self._position_of(position)
        data.qvel[self.place.velocities] = velocity
        self._world.forget_frames()

    def set_motion(self, position: FloatArray, velocity: FloatArray) -> None:
        """Set the joints' positions and all velocities, as of `set_state`; the base stays."""
        data, first = self._world.data, 7 * self._layout.has_floating_base
        data.qpos[self.place.positions][first:] = self._position_of(position)[first:]
        data.qvel[self.place.velocities] = velocity
        self._world.forget_frames()

    def _position_of(self, position: FloatArray) -> FloatArray:
        """A position (n,), message form, as MuJoCo has it.

        It is where the velocity of the same numbers leads to in 1 s, from no position at all.
        """
        model = self._world.model
        whole, velocity = self._world.data.qpos.copy(), np.zeros(model.nv)
        whole[self.place.positions] = self._identity
        velocity[self.place.velocities] = position
        mujoco.mj_integratePos(model, whole, velocity, 1.0)
        own: FloatArray = whole[self.place.positions]
        return own

    def forget_reading(self) -> None:
        """Forget nothing: the world itself knows when its state is another one."""

    def apply(self, effort: FloatArray) -> None:
        """Apply a generalised effort (n,) during the world's next step, and only then."""
        self._world.data.qfrc_applied[self.place.velocities] = effort

    def set_friction(self, friction: FloatArray) -> None:
        """Set the friction (n,) that joints oppose to contacts in the world's next step."""
        if self._has_friction:
            self._world.model.dof_frictionloss[self.place.velocities] = friction

    def push(self, pushes: Iterable[tuple[int, FloatArray, FloatArray]]) -> None:
        """Push links during the world's next step, and only then: see `sim_node.physics.engine`."""
        first = self.place.links.start
        self._world.pushes += [(first + row, wrench, point) for row, wrench, point in pushes]

    def base_frame(self) -> tuple[FloatArray, FloatArray]:
        """Origin (3,) in m and orientation xyzw (4,) of the base link in the world."""
        origins, turns = self.link_frames()
        return origins[0], turns[0]

    def link_frames(self) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m and orientations xyzw (links, 4) of the links in the world."""
        data, links = self._world.find_frames(), self.place.links
        return data.xpos[links].copy(), rotations.xyzw_from_wxyz(data.xquat[links])

    def centres(self) -> FloatArray:
        """Centres of mass (links, 3) in the world, m."""
        centres: FloatArray = self._world.find_frames().xipos[self.place.links].copy()
        return centres

    def kinetic_energy(self) -> float:
        """Kinetic energy of all links, J, by the engine's own masses, inertia and velocities."""
        model, data = self._world.model, self._world.find_frames()
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        whole, entries = np.zeros((model.nv, model.nv)), self.place.velocities
        mujoco.mj_fullM(model, data, whole)
        velocity = data.qvel[entries]
        momentum = fixed_order.apply(whole[entries, entries], velocity)
        return 0.5 * float(fixed_order.dot(velocity, momentum))

    def contact_wrenches(self) -> tuple[FloatArray, BoolArray]:
        """Net contact wrenches (links, 6) of the last step, and which links (links,) touched."""
        wrenches, touching = self._world.contacts()
        links = self.place.links
        return wrenches[links].copy(), touching[links].copy()

    def gaps(self, ball: int) -> FloatArray:
        """Distance (links,) of each link's surface to a ball's, m; inf where there is none.

        `ball` is its place in the order of throws.
        """
        model, data = self._world.model, self._world.find_frames()
        links = self.place.links
        gaps = np.full(self._link_count, np.inf)
        other = int(model.body_geomadr[self._world.balls.balls[ball].place.links.start])
        for shape, body in enumerate(model.geom_bodyid.tolist()):
            if links.start <= body < links.stop:
                gap = mujoco.mj_geomDistance(model, data, shape, other, _SEARCH_DISTANCE, None)
                gaps[body - links.start] = min(gaps[body - links.start], gap)
        return gaps
