"""Drags as springs, and throws: what is done in the browser, as messages that anybody could send.

A drag is a spring between the grabbed point of a link and the pointer, in the plane through that
point that faces the camera. A push holds for the simulator's `wrench_duration`, and the pushes of a
drag overlap; each has the share of the force that makes their sum the spring's.
"""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.messages.throw import ProjectileThrow, natural_radius

STIFFNESS, LIMIT = 400.0, 1000.0  # N/m, N

POURED = 20  # balls that are poured at once

_COLUMNS = 2  # along each edge of the block of balls that are poured
_POURED_ABOVE = 1.2  # m, from a root to the lowest ball
_SPACING = 2.4  # radii, between the centres of two
_DISTANCE = 2.0  # m, from where a ball begins to where it was clicked
_FROM_CAMERA = 0.3  # m: no ball begins nearer to the camera, or behind it
_LEAST_DISTANCE = 0.3  # m
_ABOVE_GROUND = 0.01  # m


def spring_force(stiffness: float, grabbed: FloatArray, pointer: FloatArray) -> FloatArray:
    """Force (3,), N, of a spring without length from a point to the pointer, at most `LIMIT`."""
    force = stiffness * (pointer - grabbed)
    size = float(np.linalg.norm(force))
    limited: FloatArray = force * min(1.0, LIMIT / size) if size else force
    return limited


@dataclass
class Drag:
    """A point of a link that is held by the pointer."""

    below: str  # the namespace of the character
    row: int  # row of the link
    grabbed: FloatArray  # (3,) m, in the link's frame
    pointer: FloatArray  # (3,) m, the browser's
    stamp_ns: int | None = None  # stamp of the state in which the last push was sent
    force: float = 0.0  # N, the present one
    impulse: float = 0.0  # N s, since it began

    def share(self, stamp_ns: int, duration: float) -> float:
        """The share of the force that a push sent now is to have; 0: none is to be sent.

        Args:
            stamp_ns: Of the newest state.
            duration: How long a push holds, s.
        """
        elapsed = self.advance(stamp_ns)
        return min(elapsed / duration, 1.0) if duration > 0.0 else float(elapsed > 0.0)

    def advance(self, stamp_ns: int) -> float:
        """Simulated time since the last call, s; 0 at the first one, and after a restart."""
        before, self.stamp_ns = self.stamp_ns, stamp_ns
        if before is None or stamp_ns <= before:
            return 0.0
        return 1e-9 * (stamp_ns - before)


def pour_balls(root: FloatArray, mass: float) -> list[ProjectileThrow]:
    """Balls that fall on a root (3,), m, world, of a mass each, kg: a block of `POURED` above it.

    No two touch, and each layer is turned against the one below, so that they scatter.

    Raises:
        CommandError: the mass is beyond what a throw can have.
    """
    radius = natural_radius(mass)
    throws = []
    for number in range(POURED):
        layer, place = divmod(number, _COLUMNS**2)
        angle = 0.7 * layer + 0.5 * np.pi * place
        across = _SPACING * radius * 2.0**-0.5
        x, y = root[:2] + across * np.array((np.cos(angle), np.sin(angle)))
        z = root[2] + _POURED_ABOVE + _SPACING * radius * layer
        throws.append(ProjectileThrow(mass, radius, (float(x), float(y), float(z)), (0.0,) * 3))
    return throws


def aim_throw(
    ray_origin: FloatArray,
    ray_direction: FloatArray,
    centre: FloatArray,
    *,
    mass: float,
    speed: float,
    gravity: float,
) -> ProjectileThrow:
    """The ball that flies from the camera's side to a point on a ray.

    Args:
        ray_origin: Where the camera is (3,), m.
        ray_direction: Through what was clicked on (3,), of length one.
        centre: The ray's nearest point to this one (3,) is hit, m.
        mass: Of the ball, kg.
        speed: Its mean speed along the ray, m/s.
        gravity: Along -z, m/s^2; the throw makes up for it.

    Raises:
        CommandError: a number is beyond what a throw can have.
    """
    depth = float(np.dot(centre - ray_origin, ray_direction))
    target = ray_origin + depth * ray_direction
    distance = max(min(_DISTANCE, depth - _FROM_CAMERA), _LEAST_DISTANCE)
    start = target - distance * ray_direction
    radius = natural_radius(mass)
    start[2] = max(start[2], radius + _ABOVE_GROUND)
    seconds = distance / speed
    velocity = (target - start) / seconds + np.array((0.0, 0.0, 0.5 * gravity * seconds))
    x, y, z = start.tolist()
    vx, vy, vz = velocity.tolist()
    return ProjectileThrow(mass, radius, (x, y, z), (vx, vy, vz))
