"""A policy while it is calm, and planning ahead while it expects too little.

A policy answers at once, but what it was not trained on makes it fall; planning ahead takes as long
as the motion, or longer, and bears hard pushes. What the policy itself expects of a state says
first that it will not be able to bear a push. Both see the reference in the same place: who goes on
takes over where it had given way to.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from controller_node.control_laws import GainArrays
from controller_node.planner.base import DesiredAt, TickState
from controller_node.planner.outlook import Outlook
from controller_node.planner.planner import PredictivePlanner
from controller_node.planner.policy.choosing import Policies
from controller_node.planner.policy.planner import PolicyPlanner
from controller_node.planner.settings import PlannerSettings
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character

if TYPE_CHECKING:
    from controller_node.planner.commands_in_flight import CommandsInFlight

_TOO_LITTLE = 0.6  # of what it expects while it is calm; from there on it plans
_ENOUGH = 0.7  # of the same; above it the policy may go on
_CALM_S = 0.4  # s for which it must have been so


class HybridPlanner:
    """Goes over from a policy to plans, and back. It remembers which of them leads."""

    needs_contacts = False

    def __init__(self, character: Character, policies: Policies, settings: PlannerSettings) -> None:
        """Build both models of the dynamics."""
        self._rate_hz = settings.parameters.rate_hz
        self._calm_since: int | None = None  # tick
        self._predictive = PredictivePlanner(character, settings)
        self._policy = PolicyPlanner(character, policies, settings.parameters)
        self.rest()

    @property
    def in_flight(self) -> "CommandsInFlight | None":
        """The commands that have not acted yet; None where they act at once."""
        return self._predictive.in_flight

    @property
    def parts(self) -> tuple[object, ...]:
        """What is large in it and does not change."""
        return self._policy.parts

    @property
    def outlook(self) -> Outlook | None:
        """What is expected of the plan or the decision in force."""
        return (self._predictive if self.plans else self._policy).outlook

    def while_waiting(self, act: Callable[[], None]) -> None:
        """Have something done again and again while it waits for a plan."""
        self._predictive.while_waiting(act)

    def begin_episode(self, episode: int) -> None:
        """Forget all; `episode` is the tick of the episode's first state."""
        self.rest()
        self._predictive.begin_episode(episode)
        self._policy.begin_episode(episode)

    def change_reference(self, since: int = 0, clip: str = "") -> None:
        """Say that the reference is another one from a tick on; it may be a behaviour's clip."""
        if clip != self._policy.clip:
            self._calm_since = None  # another policy's calm
        self._predictive.change_reference(since, clip)
        self._policy.change_reference(since, clip)

    def rest(self) -> None:
        """Forget what leads, and where the reference had given way to: nothing is tracked."""
        self._predictive.rest()
        self._policy.rest()
        self.plans = False
        """Whether it plans ahead, rather than have the policy answer."""
        self._calm_since = None
        self._looked = -1  # the last tick of a look

    def offset(
        self, acting: TickState, seen: TickState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        """What is added to the tracking errors (n,) of a state; zero for the root.

        It plans from the state in which the offset acts; looks, and the policy, are of the state
        that is seen.
        """
        given, tick = (acting, seen, gains, desired_at), seen.tick
        if tick < self._looked:
            self.rest()  # a state of before, which comes once more
        hold = self._policy.policy.hold
        is_due = self._looked < 0 or tick // hold > self._looked // hold
        if is_due:
            self._looked = tick
        if self.plans:
            self._policy.anchor = self._predictive.anchor
            if is_due and self._is_calm(seen, gains, desired_at):
                self._hand_to_policy()
        elif not self._policy.is_trained:
            self._hand_to_plans(np.zeros(len(seen.state.velocity)))
        if not self.plans:
            offset = self._policy.offset(*given)
            if not (is_due and self._is_pushed()):
                return offset
            self._hand_to_plans(offset)
        return self._predictive.offset(*given)

    def _is_pushed(self) -> bool:
        """Whether the policy expects too little of its last decision's state."""
        return self._policy.expected < _TOO_LITTLE * self._policy.policy.calm

    def _is_calm(self, seen: TickState, gains: GainArrays, desired_at: DesiredAt) -> bool:
        """Whether a policy has expected enough of states for a while, after another one."""
        tick, policy = seen.tick, self._policy
        is_enough = (
            policy.is_trained
            and not self._is_perturbed(tick)
            and policy.expect(tick, seen.state, gains, desired_at) >= _ENOUGH * policy.policy.calm
        )
        if not is_enough:
            self._calm_since = None
            return False
        if self._calm_since is None:
            self._calm_since = tick
        return tick - self._calm_since >= _CALM_S * self._rate_hz

    def _is_perturbed(self, tick: int) -> bool:
        return self._policy.anchor.is_perturbed(tick / self._rate_hz)

    def _hand_to_plans(self, offset: FloatArray) -> None:
        self._predictive.take_over(self._policy.anchor, offset)
        self.plans, self._calm_since = True, None

    def _hand_to_policy(self) -> None:
        self._policy.rest()
        self._policy.anchor = self._predictive.anchor
        self._predictive.rest()
        self.plans = False
