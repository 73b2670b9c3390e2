"""The effort that follows a controller manager's commands. No ROS."""

import numpy as np

from actuated_characters.ros2_control.commands import JointCommand, Target
from actuated_characters.ros2_control.timetable import Timetable
from controller_node.control_laws import LawContext, TrackingInput
from controller_node.controller_settings import ControllerSettings
from controller_node.model_check import check_agreement, check_inertia
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.joints.effort_limits import EffortLimits
from msgs_config.character.model import Character
from msgs_config.messages.probe import DynamicsSample
from msgs_config.messages.state import StampedState


class CommandedLaw:
    """A control law whose reference is what was commanded last."""

    def __init__(
        self,
        character: Character,
        settings: ControllerSettings,
        timetable: Timetable,
        gravity: float,
    ) -> None:
        """Build the model of the dynamics.

        Raises:
            CharacterError: a joint moves neither mass nor inertia.
            ConfigurationError: the law cannot be made.
        """
        self._layout, self._coupling = character.layout, character.coupling
        self._model = DynamicsModel(character, gravity)
        check_inertia(self._model, character)
        tick_s = 1.0 / timetable.period.rate_hz
        self._context = LawContext(self._layout, self._model, tick_s)
        self._timetable = timetable
        self._first_tick, self._tick_s = 0, tick_s
        self.settings = settings

    @property
    def settings(self) -> ControllerSettings:
        """Law, gains and limits in force."""
        return self._settings

    @settings.setter
    def settings(self, settings: ControllerSettings) -> None:
        """Take others from the next state on; a law's memory is lost."""
        self._law = settings.make_law(self._context)
        self._limits = EffortLimits(self._layout, settings.gains.effort_limits)
        self._settings = settings

    def check_agreement(self, probe: DynamicsSample) -> None:
        """Raise CharacterError if a simulator's probe is not what the model expects."""
        check_agreement(self._model, self._layout, probe)

    def begin_episode(self, tick: int, state: StampedState) -> None:
        """Let all joints stay where they are in an episode's first state, of a tick."""
        self._first_tick = tick
        self._target = Target.standing(state.position)
        self._law = self._settings.make_law(self._context)

    def follow(self, command: JointCommand, state: StampedState) -> None:
        """Take the command of the update at a state."""
        period = self._timetable.period.seconds
        self._target = self._target.followed_by(command, state.position, period)

    def effort(self, tick: int, state: StampedState) -> FloatArray:
        """The effort (n,) that answers the state of a tick, within the limits."""
        share, ticks = self._timetable.share(tick), self._timetable.period.ticks
        tracking = TrackingInput(
            time=(tick - self._first_tick) * self._tick_s,
            position=state.position,
            velocity=state.velocity,
            now=self._desired(state, share),
            upcoming=self._desired(state, share + 1.0 / ticks),
        )
        gains = self._target.gains(self._settings.gains)
        effort = self._law(tracking, gains) * self._target.tracked + self._target.effort
        if self._coupling:
            effort = self._coupling.effort(effort)
        return self._limits.clipped(effort)

    def _desired(self, state: StampedState, share: float) -> ReferenceState:
        """The state to track; a floating base's, which no motor drives, is its own."""
        position, velocity = self._target.at(share), self._target.velocity
        if self._layout.has_floating_base:
            position, velocity = position.copy(), velocity.copy()
            position[:6], velocity[:6] = state.position[:6], state.velocity[:6]
        if self._coupling:
            position, velocity = (
                self._coupling.position(position),
                self._coupling.velocity(velocity),
            )
        return ReferenceState(
            self._layout.configuration(position), velocity, np.zeros(self._layout.size)
        )
