"""A policy while it is calm, and planning ahead while a state costs too much.

A policy answers at once, but what it was not trained on makes it fall; planning ahead takes as long
as the motion, or longer, and bears hard pushes. Both see the reference in the same place: who goes
on takes over where it had given way to.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from controller_node.control_laws import GainArrays
from controller_node.planner.base import DesiredAt
from controller_node.planner.outlook import Outlook
from controller_node.planner.planner import PredictivePlanner
from controller_node.planner.policy.file import Policy
from controller_node.planner.policy.planner import PolicyPlanner
from controller_node.planner.settings import PlannerSettings
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.messages.state import StampedState

if TYPE_CHECKING:
    from controller_node.planner.commands_in_flight import CommandsInFlight

_TOO_MUCH = 90.0  # cost from which on it plans; a walk's footfalls reach 60
_CALM = 40.0  # cost below which the policy may go on
_CALM_S = 0.4  # s for which it must have been so
_GROWS_IN, _FADES_IN = 0.08, 0.15  # s, time constants of the mean of costs


class HybridPlanner:
    """Goes over from a policy to plans, and back. It remembers which of them leads."""

    def __init__(self, character: Character, policy: Policy, settings: PlannerSettings) -> None:
        """Build both models of the dynamics."""
        self._hold, self._rate_hz = policy.hold, settings.parameters.rate_hz
        self._predictive = PredictivePlanner(character, settings)
        self._policy = PolicyPlanner(character, policy, settings.parameters)
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

    def change_reference(self, since: int = 0) -> None:
        """Say that the reference is another one from a tick on."""
        self._predictive.change_reference(since)
        self._policy.change_reference(since)

    def rest(self) -> None:
        """Forget what leads, and where the reference had given way to: nothing is tracked."""
        self._predictive.rest()
        self._policy.rest()
        self.plans = False
        """Whether it plans ahead, rather than have the policy answer."""
        self._cost = 0.0  # mean of lately
        self._calm_since: int | None = None  # tick
        self._looked = -1  # the last tick of a look

    def offset(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        """What is added to the tracking errors (n,) of a state; zero for the root.

        The arguments are those of `PredictivePlanner.offset`.
        """
        given = tick, state, gains, desired_at
        if tick < self._looked:
            self.rest()  # a state of before, which comes once more
        is_due = self._looked < 0 or tick // self._hold > self._looked // self._hold
        if self.plans:
            self._policy.anchor = self._predictive.anchor
            if is_due and self._is_calm(tick, self._policy.deviation(*given)):
                self._hand_to_policy()
        if not self.plans:
            offset = self._policy.offset(*given)
            deviation = self._policy.last_deviation
            assert deviation is not None
            if not (is_due and self._is_hard(tick, deviation)):
                return offset
            self._hand_to_plans(offset)
        return self._predictive.offset(*given)

    def _is_hard(self, tick: int, deviation: FloatArray) -> bool:
        """Whether states have cost too much lately, after another one, or it is pushed off."""
        self._look(tick, deviation, _GROWS_IN)
        return self._cost > _TOO_MUCH or self._is_perturbed(tick)

    def _is_calm(self, tick: int, deviation: FloatArray) -> bool:
        """Whether states have cost little for a while, after another one."""
        self._look(tick, deviation, _FADES_IN)
        if self._cost > _CALM or self._is_perturbed(tick):
            self._calm_since = None
            return False
        if self._calm_since is None:
            self._calm_since = tick
        return tick - self._calm_since >= _CALM_S * self._rate_hz

    def _look(self, tick: int, deviation: FloatArray, keeps: float) -> None:
        cost = self._predictive.cost_of(deviation, perturbed=self._is_perturbed(tick))
        share = min(self._hold / (keeps * self._rate_hz), 1.0)
        self._cost += share * (cost - self._cost)
        self._looked = tick

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
