"""Where the reference's world is: it gives way to what the character cannot undo, and returns.

A push that moves the character by a step cannot be undone at once by its feet. So while it is
perturbed the reference's world is moved and turned after the character, and slowly back all the
while: a point p of it is at `R p + t` in the world, with R the turn about z by `yaw`. A reference
that stands has no steps for a way back: its world follows the character as it comes to stand, too,
and stays there until the reference goes on. On uneven ground it is as high as the feet that stand.
"""

import math
from dataclasses import dataclass

import numpy as np

from controller_node.planner.compiled.anchoring import advance_anchor
from controller_node.planner.felt_ground import FeltGround
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

_NOTHING_FELT = FeltGround()


@dataclass(frozen=True)
class PlanarState:
    """How a character moves over the ground, in the world or in the reference's."""

    centre: complex  # m, of the centre of mass, x + i y
    velocity: complex  # m/s
    root: FloatArray  # (4,) orientation xyzw
    turn: float = 0.0  # rad/s of the root about z


@dataclass(frozen=True)
class Anchor:
    """Where the reference's world is in the world: moved about, turned about z, and lifted."""

    place: complex = 0j  # t, m, x + i y
    yaw: float = 0.0  # rad
    calm_from: float = 0.0  # s since the episode began; until then the character is perturbed
    settled_from: float = 0.0  # s in the episode; until then the reference has not stood for long
    ground: FeltGround = _NOTHING_FELT

    @property
    def lift(self) -> float:
        """How high its ground is in the world, m."""
        return self.ground.level

    def is_perturbed(self, time: float) -> bool:
        """Whether the character is at a time in s: the feet go where they catch it."""
        return time < self.calm_from

    def to_reference_world(
        self, position: FloatArray, velocity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """A state of the world in the reference's: MuJoCo's position (q,), velocity (n,)."""
        if self.place == 0 and self.yaw == 0.0 and self.lift == 0.0:
            return position, velocity  # unchanged to the last bit
        position, velocity = position.copy(), velocity.copy()
        back = _turn(-self.yaw)
        position[:2] = _pair(back * (complex(*position[:2]) - self.place))
        position[2] -= self.lift
        velocity[:2] = _pair(back * complex(*velocity[:2]))
        root = rotations.xyzw_from_wxyz(position[3:7])
        turned = rotations.multiply(rotations.about_z(-self.yaw), root)
        position[3:7] = rotations.wxyz_from_xyzw(turned)
        return position, velocity

    def to_world(self, points: FloatArray) -> FloatArray:
        """Points (m, 3) of the reference's world in the world, m."""
        shift = np.array((self.place.real, self.place.imag, self.lift))
        placed: FloatArray = rotations.rotate(rotations.about_z(self.yaw), points) + shift
        return placed

    def advanced(
        self,
        state: PlanarState,
        wanted: PlanarState,
        soon: PlanarState,
        time: float,
        elapsed: float,
    ) -> "Anchor":
        """Where it is next, after a look at a state and at the reference, all in the latter's.

        Args:
            state: The character.
            wanted: The reference.
            soon: The reference `SOON` s later.
            time: s since the episode began.
            elapsed: s since the last look.
        """
        return Anchor(
            *advance_anchor(
                self.place,
                self.yaw,
                self.calm_from,
                self.settled_from,
                state.centre,
                state.velocity,
                _heading(state.root, wanted.root),
                wanted.centre,
                wanted.velocity,
                soon.velocity,
                wanted.turn,
                time,
                elapsed,
            ),
            self.ground,
        )


def planar_state(
    position: FloatArray, velocity: FloatArray, centre: FloatArray, centre_velocity: FloatArray
) -> PlanarState:
    """How a state moves over the ground.

    Args:
        position: MuJoCo's (q,).
        velocity: MuJoCo's (n,), with the root's angular velocity in its own frame.
        centre: Of mass (3,), m.
        centre_velocity: (3,) m/s.
    """
    root = rotations.xyzw_from_wxyz(position[3:7])
    turn = float(rotations.rotate(root, velocity[3:6])[2])
    return PlanarState(complex(*centre[:2]), complex(*centre_velocity[:2]), root, turn)


def _heading(root: FloatArray, wanted: FloatArray) -> float:
    """The turn about z in rad, -pi to pi, by which a root is off another; orientations xyzw (4,).

    Not the difference of two headings: a body that lies or flips over has none.
    """
    return float(rotations.yaw(rotations.multiply(root, rotations.conjugate(wanted))))


def _turn(angle: float) -> complex:
    return complex(math.cos(angle), math.sin(angle))


def _pair(number: complex) -> FloatArray:
    return np.array((number.real, number.imag))
