"""The links of one body in the engine: where they are, what pushes them, what they touch.

Arrays have one row a link, in the order of `Character.links`; frames are URDF link frames.
"""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.bullet import pybullet
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order, rotations
from sim_node.physics.contacts import TouchedLinks
from sim_node.physics.wrenches import ExternalWrench

_FAR = 1e3  # m, beyond which the engine need not look for what is near


class Links:
    """Reads and pushes the links of a body."""

    def __init__(
        self, client: int, body: int, character: Character, numbers: Sequence[int]
    ) -> None:
        """`numbers` are the engine's own of the character's links; -1 is the base."""
        self._client = client
        self._body = body
        self._numbers = list(numbers)
        self._row = {number: row for row, number in enumerate(numbers)}
        poses = [link.inertial_pose for link in character.links]
        self._offsets = np.array([pose.position for pose in poses])
        turns = np.array([pose.orientation_xyzw for pose in poses])
        self._turns_back = rotations.conjugate(turns)

    def frames(self) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m and orientations xyzw (links, 4) in the world."""
        centres, inertial_turns = self._inertial_frames()
        turns = rotations.multiply(inertial_turns, self._turns_back)
        return centres - rotations.rotate(turns, self._offsets), turns

    def base_frame(self) -> tuple[FloatArray, FloatArray]:
        """Origin (3,) in m and orientation xyzw (4,) of the base link in the world."""
        centre, inertial_turn = pybullet.getBasePositionAndOrientation(
            self._body, physicsClientId=self._client
        )
        turn = rotations.multiply(np.array(inertial_turn), self._turns_back[0])
        return centre - rotations.rotate(turn, self._offsets[0]), turn

    def kinetic_energy(self) -> float:
        """Kinetic energy of all links, J, by the engine's own masses, inertia and velocities."""
        energy = 0.0
        for number in self._numbers:
            mass, _, inertia, *_ = pybullet.getDynamicsInfo(
                self._body, number, physicsClientId=self._client
            )
            turn, linear, angular = self._inertial_motion(number)
            spin = rotations.rotate(rotations.conjugate(turn), angular)  # about principal axes
            moving = mass * fixed_order.dot(linear, linear)
            energy += 0.5 * float(moving + fixed_order.dot(spin * spin, np.array(inertia)))
        return energy

    def _inertial_motion(self, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Orientation xyzw, velocity (m/s) and angular velocity (rad/s, world) about the centre."""
        body, client = self._body, self._client
        if number < 0:
            _, turn = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
            linear, angular = pybullet.getBaseVelocity(body, physicsClientId=client)
        else:
            _, turn, *_, linear, angular = pybullet.getLinkState(
                body,
                number,
                computeLinkVelocity=1,
                computeForwardKinematics=1,
                physicsClientId=client,
            )
        return np.array(turn), np.array(linear), np.array(angular)

    def push(self, pushes: Sequence[ExternalWrench]) -> None:
        """Push links during the engine's next step, and only then.

        A force acts at its point, which makes the torque `r x f` about the centre of mass more.
        """
        origins, turns = self.frames()
        for push in pushes:
            row, number = push.link, self._numbers[push.link]
            at = origins[row] + rotations.rotate(turns[row], push.point)
            for apply, vector, where in (
                (pybullet.applyExternalForce, push.wrench[:3], (at,)),
                (pybullet.applyExternalTorque, push.wrench[3:], ()),
            ):
                apply(
                    self._body,
                    number,
                    vector,
                    *where,
                    flags=pybullet.WORLD_FRAME,
                    physicsClientId=self._client,
                )

    def centres(self) -> list[Sequence[float]]:
        """Centres of mass (links, 3) in the world, m; plain numbers, of which few are used."""
        return [state[0] for state in self._states()]

    def contact_wrenches(
        self, touched: TouchedLinks, centres: Sequence[Sequence[float]]
    ) -> tuple[FloatArray, BoolArray]:
        """Net contact wrench (links, 6) of what touches, world axes; and which links do.

        It is the force in N, and the torque in N m about `centres` (links, 3), the links' centres
        of mass when the engine's step began. A contact between two links of the body counts on
        both, in opposite directions.
        """
        sums: dict[int, list[float]] = {}  # by row; plain numbers: of few contacts it is faster
        for number, (fx, fy, fz), (px, py, pz) in touched.get(self._body, ()):
            row = self._row[number]
            cx, cy, cz = centres[row]
            x, y, z = px - cx, py - cy, pz - cz
            total = sums.setdefault(row, [0.0] * 6)
            total[0] += fx
            total[1] += fy
            total[2] += fz
            total[3] += y * fz - z * fy
            total[4] += z * fx - x * fz
            total[5] += x * fy - y * fx
        wrenches = np.zeros((len(self._numbers), 6))
        touching = np.zeros(len(self._numbers), dtype=np.bool_)
        for row, total in sums.items():
            wrenches[row], touching[row] = total, True
        return wrenches, touching

    def gaps(self, body: int) -> FloatArray:
        """How far (links,) its surfaces are from another body's, m; inf where there is none."""
        gaps = np.full(len(self._numbers), np.inf)
        for point in pybullet.getClosestPoints(
            self._body, body, distance=_FAR, physicsClientId=self._client
        ):
            row, distance = self._row[point[3]], point[8]
            gaps[row] = min(gaps[row], distance)
        return gaps

    def _inertial_frames(self) -> tuple[FloatArray, FloatArray]:
        """Centres of mass (links, 3) and orientations xyzw of the inertial frames."""
        states = self._states()
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def _states(self) -> Sequence[tuple[Sequence[float], ...]]:
        """What the engine says of each link: first of all where its inertial frame is."""
        body, client = self._body, self._client
        base = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        moving = self._numbers[1:]
        if not moving:
            return (base,)
        return (
            base,
            *pybullet.getLinkStates(
                body, moving, computeForwardKinematics=1, physicsClientId=client
            ),
        )
