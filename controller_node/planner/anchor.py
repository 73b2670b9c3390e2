"""Where the reference's world is: it gives way to what the character cannot undo, and returns.

A push that moves the character by a step cannot be undone at once by its feet. So while it is
perturbed the reference's world is moved and turned after the character, and slowly back all the
while: a point p of it is at `R p + t` in the world, with R the turn about z by `yaw`. A reference
that stands has no steps for a way back: its world follows the character as it comes to stand, too,
and stays there until the reference goes on.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

_PERTURBED_AT = 0.28  # m from the reference's centre of mass at which it is perturbed
_FAST = 0.8  # m/s off the reference at which it is perturbed; an unpushed walk reaches 0.63
_PERTURBED_SECONDS = 1.0  # s that it stays perturbed, and that the reference counts as just stopped
_FOLLOWS_IN = 0.3  # s, time constant with which the place gives way
_TURNS_IN = 1.0  # s, time constant with which the heading gives way
_RETURNS_IN = 3.0  # s, time constant of place and heading on the way back
_TRAVELS = 0.02  # m/s of the reference's centre of mass from which on it goes somewhere
_TURNS = 0.02  # rad/s of the reference's root about z from which on it goes somewhere
_RETURN_SPEED = 0.15  # m/s, at most, of the place on the way back


@dataclass(frozen=True)
class PlanarState:
    """How a character moves over the ground, in the world or in the reference's."""

    centre: complex  # m, of the centre of mass, x + i y
    velocity: complex  # m/s
    root: FloatArray  # (4,) orientation xyzw
    turn: float = 0.0  # rad/s of the root about z


@dataclass(frozen=True)
class Anchor:
    """Where the reference's world is in the world; moved about the ground and turned about z."""

    place: complex = 0j  # t, m, x + i y
    yaw: float = 0.0  # rad
    calm_from: float = 0.0  # s since the episode began; until then the character is perturbed
    settled_from: float = 0.0  # s in the episode; until then the reference has not stood for long

    def is_perturbed(self, time: float) -> bool:
        """Whether the character is at a time in s: the feet go where they catch it."""
        return time < self.calm_from

    def to_reference_world(
        self, position: FloatArray, velocity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """A state of the world in the reference's: MuJoCo's position (q,), velocity (n,)."""
        if self.place == 0 and self.yaw == 0.0:
            return position, velocity  # unchanged to the last bit
        position, velocity = position.copy(), velocity.copy()
        back = _turn(-self.yaw)
        position[:2] = _pair(back * (complex(*position[:2]) - self.place))
        velocity[:2] = _pair(back * complex(*velocity[:2]))
        root = rotations.xyzw_from_wxyz(position[3:7])
        turned = rotations.multiply(rotations.about_z(-self.yaw), root)
        position[3:7] = rotations.wxyz_from_xyzw(turned)
        return position, velocity

    def to_world(self, points: FloatArray) -> FloatArray:
        """Points (m, 3) of the reference's world in the world, m."""
        shift = np.array((self.place.real, self.place.imag, 0.0))
        placed: FloatArray = rotations.rotate(rotations.about_z(self.yaw), points) + shift
        return placed

    def advanced(
        self, state: PlanarState, wanted: PlanarState, time: float, elapsed: float
    ) -> "Anchor":
        """Where it is next, after a look at a state and at the reference, both in the latter's.

        Args:
            state: The character.
            wanted: The reference.
            time: s since the episode began.
            elapsed: s since the last look.
        """
        error = state.centre - wanted.centre
        far = _length(error) > _PERTURBED_AT or _length(state.velocity - wanted.velocity) > _FAST
        travels = _length(wanted.velocity) > _TRAVELS or abs(wanted.turn) > _TURNS
        calm_from = time + _PERTURBED_SECONDS if far else self.calm_from
        settled_from = time + _PERTURBED_SECONDS if travels else self.settled_from
        anchor = replace(self, calm_from=calm_from, settled_from=settled_from)
        if anchor.is_perturbed(time) or (not travels and time < settled_from):
            anchor = anchor._followed(state, wanted, elapsed)
        return anchor._returned(wanted.centre, elapsed) if travels else anchor

    def _followed(self, state: PlanarState, wanted: PlanarState, elapsed: float) -> "Anchor":
        """A part of the way to the character."""
        yaw = self.yaw + min(elapsed / _TURNS_IN, 1.0) * _heading(state.root, wanted.root)
        before = _turn(self.yaw) * state.centre + self.place
        share = min(elapsed / _FOLLOWS_IN, 1.0)
        place = before - _turn(yaw) * (state.centre - share * (state.centre - wanted.centre))
        return replace(self, place=place, yaw=yaw)

    def _returned(self, centre: complex, elapsed: float) -> "Anchor":
        """A part of the way back, as seen where the reference's centre of mass is."""
        away = _turn(self.yaw) * centre + self.place - centre
        share = min(elapsed / _RETURNS_IN, 1.0)
        yaw = (1.0 - share) * self.yaw
        if share * _length(away) > _RETURN_SPEED * elapsed:
            share = _RETURN_SPEED * elapsed / _length(away)
        place = centre + (1.0 - share) * away - _turn(yaw) * centre
        return replace(self, place=place, yaw=yaw)


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


def _length(number: complex) -> float:
    return math.sqrt(number.real * number.real + number.imag * number.imag)


def _pair(number: complex) -> FloatArray:
    return np.array((number.real, number.imag))
