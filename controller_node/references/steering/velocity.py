"""Commanded velocities, and the limits that they are kept within."""

import math
from dataclasses import dataclass, replace

from msgs_config.settings import Settings, parameter

_BACKWARD, _SIDEWAYS = 0.6, 0.3  # largest speeds, m/s


@dataclass(frozen=True)
class VelocityCommand:
    """A velocity to reach, in the character's own frame, from a tick of the episode on."""

    tick: int
    forward: float  # m/s
    left: float = 0.0  # m/s
    turn: float = 0.0  # rad/s, to the left

    def is_like(self, other: "VelocityCommand") -> bool:
        """Whether another one asks for the same, whenever."""
        return replace(self, tick=other.tick) == other


STOP = VelocityCommand(0, 0.0)


@dataclass(frozen=True)
class VelocityRegion:
    """The largest velocities that a character can go at, all of them together."""

    ahead: float = math.inf  # m/s
    back: float = math.inf  # m/s
    aside: float = math.inf  # m/s, to either side
    turn: float = math.inf  # rad/s, to either side


class SteeringLimits(Settings, prefix="steering."):
    """How fast it may go, how fast that changes, and how long a command holds."""

    speed: float = parameter(2.5, "its largest speed ahead", unit="m/s", maximum=10.0)
    acceleration: float = parameter(1.3, "of its speed", unit="m/s^2", minimum=0.01, maximum=100.0)
    braking: float = parameter(
        2.2, "likewise, while it slows down", unit="m/s^2", minimum=0.01, maximum=100.0
    )
    turn_rate: float = parameter(1.0, "its largest turn rate", unit="rad/s", maximum=10.0)
    turn_acceleration: float = parameter(
        1.5, "of its turn rate", unit="rad/s^2", minimum=0.01, maximum=100.0
    )
    timeout: float = parameter(
        1.0,
        "simulated time after a command at which it stops, unless another one comes",
        unit="s",
        minimum=0.1,
        maximum=1e6,
    )
    region: VelocityRegion = VelocityRegion(back=_BACKWARD, aside=_SIDEWAYS)

    def clamped(self, command: VelocityCommand) -> VelocityCommand:
        """The nearest command within the limits."""
        return VelocityCommand(
            command.tick,
            min(
                max(command.forward, -min(self.region.back, self.speed)),
                min(self.region.ahead, self.speed),
            ),
            within(command.left, min(self.region.aside, self.speed)),
            within(command.turn, min(self.region.turn, self.turn_rate)),
        )

    def narrowed(self, region: VelocityRegion) -> "SteeringLimits":
        """The limits that keep a command within a region as well."""
        own = self.region
        both = VelocityRegion(
            min(own.ahead, region.ahead),
            min(own.back, region.back),
            min(own.aside, region.aside),
            min(own.turn, region.turn),
        )
        return replace(self, region=both)

    def approach(self, speed: float, wanted: float, period: float) -> float:
        """The speed in m/s that is nearest to a wanted one after a period in s."""
        slows = abs(wanted) < abs(speed) or wanted * speed < 0.0
        most = self.braking if slows else self.acceleration
        return speed + within(wanted - speed, most * period)

    def time_to_stop(self, forward: float, left: float, turn: float) -> float:
        """Time in s until it stands, of velocities in m/s and rad/s, once it is told to."""
        fastest = max(abs(forward), abs(left))
        return max(fastest / self.braking, abs(turn) / self.turn_acceleration)


def within(value: float, most: float) -> float:
    """The nearest value whose size is at most `most`."""
    return min(max(value, -most), most)
