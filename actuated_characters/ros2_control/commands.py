"""What a controller manager commands, as the target of a control law at each tick. No ROS."""

from dataclasses import dataclass, replace

import numpy as np

from controller_node.control_laws import GainArrays
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.errors import MessageError
from msgs_config.messages.joint_state import JointArrays


@dataclass(frozen=True)
class JointCommand:
    """A command in the layout's order; NaN where nothing is commanded."""

    position: FloatArray  # (n,) rad or m
    velocity: FloatArray  # (n,) rad/s or m/s
    effort: FloatArray  # (n,) N m or N

    @property
    def commands_anything(self) -> bool:
        """Whether any number is finite: a controller that is active has claimed a joint."""
        return any(np.isfinite(each).any() for each in (self.position, self.velocity, self.effort))


def command_in_layout(layout: JointLayout, arrays: JointArrays) -> JointCommand:
    """A received command in the layout's order, matched by name.

    Raises:
        MessageError: a list has neither one number for each name nor none. Names are left out of a
            list where joints have different command interfaces, so whose they are is not known.
        LayoutError: a name is unknown or twice.
    """
    indices = layout.indices(arrays.names)
    found = []
    for what in ("position", "velocity", "effort"):
        values = getattr(arrays, what)
        if len(values) not in (0, len(indices)):
            raise MessageError(
                f"{len(indices)} names but {len(values)} numbers in '{what}'; all joints of the "
                "ros2_control tag must have the same command interfaces"
            )
        own = np.full(layout.size, np.nan)
        if len(values):
            own[indices] = values
        found.append(own)
    return JointCommand(*found)


@dataclass(frozen=True)
class Target:
    """Where the joints are to be at the end of an update's period, and on the way there."""

    start: FloatArray  # (n,) rad or m, at the update
    end: FloatArray  # (n,) rad or m, at the next one
    velocity: FloatArray  # (n,) rad/s or m/s
    effort: FloatArray  # (n,) N m or N, in addition
    tracked: BoolArray  # (n,) which entries a law tracks; of the others the effort is all

    @classmethod
    def standing(cls, position: FloatArray) -> "Target":
        """To stay at a position (n,)."""
        still = np.zeros(len(position))
        return cls(position, position, still, still, np.ones(len(position), dtype=np.bool_))

    def at(self, share: float) -> FloatArray:
        """The position (n,) after a share of the period, 0 to 1: on the straight line."""
        return self.start + min(share, 1.0) * (self.end - self.start)

    def gains(self, gains: GainArrays) -> GainArrays:
        """Gains with none where nothing is tracked."""
        if self.tracked.all():
            return gains
        return replace(
            gains,
            stiffness=np.where(self.tracked, gains.stiffness, 0.0),
            damping=np.where(self.tracked, gains.damping, 0.0),
            integral=np.where(self.tracked, gains.integral, 0.0),
        )

    def followed_by(self, command: JointCommand, position: FloatArray, period: float) -> "Target":
        """The target of the next update, at which the joints are at a `position` (n,).

        A commanded position is reached at the end of the `period` (s), on a straight line as a
        drive interpolates; a velocity alone moves the target on; an effort alone is all that acts,
        and the target waits where the joint is. What is not commanded stays where it was told to
        be last.
        """
        has_position, has_velocity, has_effort = (
            np.isfinite(each) for each in (command.position, command.velocity, command.effort)
        )
        tracked = has_position | has_velocity | ~has_effort
        start = np.where(self.tracked & tracked, self.end, position)
        velocity = np.where(has_velocity, command.velocity, 0.0)
        end = np.where(has_position, command.position, start + period * velocity)
        moved = np.where(has_position & ~has_velocity, (end - start) / period, velocity)
        effort = np.where(has_effort, command.effort, 0.0)
        return Target(start, end, moved, effort, tracked)
