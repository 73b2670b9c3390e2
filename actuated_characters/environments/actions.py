"""What the actions of an environment mean: targets of the character's joints, or their torques."""

from typing import Protocol

import numpy as np
from gymnasium import spaces

from actuated_characters.environments.motion import EpisodeMotion
from controller_node.control_laws import LAWS, GainArrays, LawContext, TrackingInput
from controller_node.controller_settings import ControllerSettings, effective_gains
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.joints.effort_limits import EffortLimits
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState

TARGETS, ANGLES, TORQUES = "targets", "angles", "torques"
ACTIONS = (TARGETS, ANGLES, TORQUES)

_LARGEST_OFFSET = 1.0  # rad, or m where a slider has no limits


class Actuation(Protocol):
    """From an action to the efforts of the ticks in which it is held."""

    @property
    def space(self) -> spaces.Space[FloatArray]:
        """The actions (a,)."""
        ...

    def hold(self, action: FloatArray) -> None:
        """Hold an action (a,) from now on."""
        ...

    def effort(self, tick: int, state: StampedState) -> FloatArray:
        """The effort (n,) that answers the state of a tick, N m and N; none on a floating base."""
        ...


class TorqueActuation:
    """The action is the efforts (a,) of the motors, N m and N, within their limits."""

    def __init__(self, character: Character) -> None:
        layout = character.layout
        self._actuated = layout.mask(layout.actuated_joint_names)
        self.space = action_space(TORQUES, character)
        self._effort = np.zeros(layout.size)

    def hold(self, action: FloatArray) -> None:
        """Hold efforts (a,)."""
        self._effort[self._actuated] = action

    def effort(self, tick: int, state: StampedState) -> FloatArray:
        """The efforts held."""
        return self._effort


class TargetActuation:
    """The control law in each tick, to targets that the action moves or gives.

    `targets`: the action is an offset (a,) to the joints' tracking errors, rad and m; of a ball
    joint a rotation vector in the child frame. At zero the law tracks the reference.

    `angles`: the action is the joints' positions (a,) in message form, instead of the reference's.

    The velocity to track is the reference's in either case, or zero as the parameter
    `reference_velocity` says.
    """

    def __init__(
        self,
        action: str,
        character: Character,
        settings: ControllerSettings,
        motion: EpisodeMotion,
        model: DynamicsModel,
        clock: TickClock,
    ) -> None:
        """Prepare the law and its gains, which drive no floating base.

        Raises:
            ConfigurationError: the law tracks no target, or remembers the ticks before.
        """
        if not LAWS[settings.law].is_static_feedback:
            laws = ", ".join(name for name in LAWS.names if LAWS[name].is_static_feedback)
            raise ConfigurationError(
                f"law '{settings.law}' follows no target of an action; "
                f"there are: {laws}; or take action='{TORQUES}'"
            )
        self._layout, self._motion, self._clock = character.layout, motion, clock
        self._law = settings.make_law(LawContext(self._layout, model, clock.period_s))
        whole = np.ones(len(self._layout.vector_lengths))
        self._gains: GainArrays = effective_gains(self._layout, settings, whole).gains
        self._limits = EffortLimits(self._layout, self._gains.effort_limits)
        self._follows_velocity = settings.follows_velocity
        self._actuated = self._layout.mask(self._layout.actuated_joint_names)
        self._still = np.zeros(self._layout.size)
        self._is_absolute = action == ANGLES
        self.space = action_space(action, character)
        self._offset: FloatArray | None = None  # (n,); None: nothing is added, not even a zero
        # Takes the place of the reference's position.
        self._target: GeneralizedPosition | None = None

    def hold(self, action: FloatArray) -> None:
        """Hold offsets or positions (a,)."""
        whole = np.zeros(self._layout.size)
        whole[self._actuated] = action
        if not self._is_absolute:
            self._offset = whole if whole.any() else None
            return
        self._target = self._layout.configuration(whole)

    def effort(self, tick: int, state: StampedState) -> FloatArray:
        """The law's effort within the limits, N m and N."""
        tracking = TrackingInput(
            time=self._clock.time_after(tick),
            position=state.position,
            velocity=state.velocity,
            now=self._desired(tick),
            upcoming=self._desired(tick + 1),
            offset=self._offset,
        )
        effort = self._limits.clipped(self._law(tracking, self._gains))
        return np.where(self._actuated, effort, 0.0)

    def _desired(self, tick: int) -> ReferenceState:
        desired = self._motion.at(tick)
        if self._target is None and self._follows_velocity:
            return desired
        return ReferenceState(
            desired.configuration if self._target is None else self._target,
            desired.velocity if self._follows_velocity else self._still,
            desired.acceleration,
        )


def check_action(action: str) -> None:
    """Raise ConfigurationError if it is none of `ACTIONS`."""
    if action not in ACTIONS:
        raise ConfigurationError(one_of("action", action, list(ACTIONS)))


def action_space(action: str, character: Character) -> spaces.Space[FloatArray]:
    """The actions (a,) of a kind, one entry an actuated degree of freedom."""
    layout = character.layout
    if action == TORQUES:
        upper = np.repeat(character.effort_limits(), layout.vector_lengths)
        lower = -upper
    else:
        lower, upper = (_angle_bounds if action == ANGLES else _offset_bounds)(character)
    actuated = layout.mask(layout.actuated_joint_names)
    return spaces.Box(lower[actuated], upper[actuated], dtype=np.float64)


def _offset_bounds(character: Character) -> tuple[FloatArray, FloatArray]:
    """Bounds (n,) of offsets: 1 rad; of a slider its range, at most 1 m."""
    lower, upper = character.position_bounds()
    bound = np.full(character.layout.size, _LARGEST_OFFSET)
    for joint in character.layout.joints:
        if joint.type is JointType.PRISMATIC:
            bound[joint.entries] = np.minimum((upper - lower)[joint.entries], _LARGEST_OFFSET)
    return -bound, bound


def _angle_bounds(character: Character) -> tuple[FloatArray, FloatArray]:
    """Bounds (n,) of positions: the joints' own; without any pi, and 1 m of a slider."""
    lower, upper = character.position_bounds()
    widest = np.full(character.layout.size, np.pi)
    for joint in character.layout.joints:
        if joint.type is JointType.PRISMATIC:
            widest[joint.entries] = _LARGEST_OFFSET
    lower, upper = (np.where(np.isfinite(b), b, s * widest) for b, s in ((lower, -1), (upper, 1)))
    return lower, np.maximum(upper, lower)
