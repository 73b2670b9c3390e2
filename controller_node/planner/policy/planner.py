"""A trained policy in a planner's place: an answer of a network instead of a search.

A decision holds for some ticks. The policy sees how the state deviates from the reference, which
gives way to pushes as a planner's does, and where the reference leads; its answer is what a planner
finds: offsets to the tracking errors. (Peng et al. 2018, "DeepMimic".)
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from controller_node.control_laws import GainArrays
from controller_node.planner.anchor import Anchor
from controller_node.planner.base import DesiredAt, TickState
from controller_node.planner.compiled.anchoring import SOON
from controller_node.planner.compiled.network import evaluate
from controller_node.planner.compiled.observation import (
    decide,
    find_deviation,
    heading,
    observe,
    write_frame,
)
from controller_node.planner.compiled.rollout import RolloutModel, features_against
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.outlook import Outlook
from controller_node.planner.policy.choosing import Policies
from controller_node.planner.policy.file import Policy
from controller_node.planner.sampled_reference import ReferenceSample
from controller_node.planner.settings import PlannerParameters
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.character.model import Character
from msgs_config.messages.state import StampedState

if TYPE_CHECKING:
    from controller_node.planner.commands_in_flight import CommandsInFlight


@dataclass(frozen=True)
class Told(ReferenceSample):
    """The reference at one tick, as a policy is told of it."""

    frame: FloatArray  # (d,)
    facing: float  # rad


class PolicyPlanner:
    """Answers each decision in constant time. It remembers the last one, and the anchor."""

    needs_contacts = False

    def __init__(
        self,
        character: Character,
        policies: Policies,
        given: PlannerParameters,
        in_flight: "CommandsInFlight | None" = None,
    ) -> None:
        """Build the model of the dynamics."""
        self._made_of = (character, policies, given)
        self.in_flight = in_flight
        self._policies, self._given = policies, given
        self.clip = ""
        """The one that a behaviour has the reference go over to; empty: the own motion."""
        self._model = ContactModel.of(character, given)
        self._engine = self._model.engine()
        self._centre = policies.own.scales.centre
        self._gains: GainArrays | None = None
        self._told: dict[int, Told] = {}
        self._later = round(SOON * given.rate_hz)
        self._compile(character)

    def __reduce__(self) -> tuple[object, ...]:
        """For a copy, in this process or another: it goes on alike."""
        sent = None if self.in_flight is None else self.in_flight.sent()
        looked = (self.anchor, self.outlook, self.expected)
        state = (self._offset, self._decided, self.clip, looked, sent)
        return _copy_of, (self._made_of, state)

    @property
    def parts(self) -> tuple[object, ...]:
        """What is large in it and does not change."""
        return self._policies.own, *self._policies.others.values()

    @property
    def is_trained(self) -> bool:
        """Whether there is a policy of what is tracked, which may be a behaviour's clip."""
        return not self.clip or self.clip in self._policies.others

    @property
    def policy(self) -> Policy:
        """That of what is tracked; the own motion's where there is none."""
        return self._policies.others.get(self.clip, self._policies.own)

    def while_waiting(self, act: Callable[[], None]) -> None:
        """It does not wait."""

    def begin_episode(self, episode: int) -> None:
        """Forget all."""
        del episode
        self.clip = ""
        self._told.clear()
        self.rest()
        if self.in_flight is not None:
            self.in_flight.clear()

    def change_reference(self, since: int = 0, clip: str = "") -> None:
        """Forget the reference from a tick on; the decision in force stays."""
        self.clip = clip
        for tick in [tick for tick in self._told if tick >= since]:
            del self._told[tick]

    def rest(self) -> None:
        """Forget the decision, and where the reference had given way to: nothing is tracked."""
        self._offset: FloatArray | None = None
        self._decided = 0
        self.anchor = Anchor()
        """Where the reference's world is."""
        self.outlook: Outlook | None = None
        self.expected = 1.0
        """What the last decision expected: see `expect`."""

    def offset(
        self, acting: TickState, seen: TickState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        """What is added to the tracking errors (n,) of a state; zero for the root.

        It decides from the state that is seen, though that is some ticks old when it acts: a small
        part of a decision. What is foreseen is off where a foot lands, by tens of rad/s of an
        ankle, and a policy that is told of it falls.
        """
        del acting
        tick, state, hold = seen.tick, seen.state, self.policy.hold
        if self._offset is not None and tick < self._decided:
            self.rest()  # a state of before, which comes once more
        if self._offset is None or tick // hold > self._decided // hold:
            self._offset = self._decide(tick, state, gains, desired_at)
            self._decided = tick
        return self._offset

    def _compile(self, character: Character) -> None:
        """Have all compiled before the first state waits for an answer: one decision at rest."""
        layout = character.layout
        rest, nothing = np.array(character.rest_position), np.zeros(layout.size)
        still = ReferenceState(layout.configuration(rest), nothing, nothing)
        gains = GainArrays(nothing, nothing, nothing, character.effort_limits())
        self.rest()
        given = 0, StampedState(0, rest, nothing, None), gains, lambda _: still
        self._decide(*given)
        self.expect(*given)
        self.begin_episode(0)

    def expect(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> float:
        """What it expects of a state, where the reference has given way to; it remembers nothing.

        From 0 to about 1: the mean reward from there on.
        """
        body = self._body_of(gains)
        frames = self._frames(tick, desired_at, body)
        observation = self._observation(self._look(state, frames[0], body), frames)
        value = np.empty(1, np.float32)
        evaluate(self.policy.value, observation, value)
        return float(value[0])

    def _body_of(self, gains: GainArrays) -> RolloutModel:
        if gains is not self._gains:
            self._gains, self._body = gains, self._model.body(gains)
        return self._body

    def _decide(
        self, tick: int, state: StampedState, gains: GainArrays, desired_at: DesiredAt
    ) -> FloatArray:
        policy, body = self.policy, self._body_of(gains)
        frames = self._frames(tick, desired_at, body)
        now, look = frames[0], self._look(state, frames[0], body)
        soon = self._tell(tick + self._later, desired_at, body)
        if self._given.gives_way and self._follow(tick, look, now, soon):
            look = self._look(state, now, body)
        observation = self._observation(look, frames)
        offset = np.zeros(len(state.velocity))
        self.expected = decide(
            offset[6:], policy.network, policy.value, observation, policy.unit, policy.largest
        )
        self.outlook = self._outlook(look.features)
        return offset

    def _frames(self, tick: int, desired_at: DesiredAt, body: RolloutModel) -> list[Told]:
        """The reference now and ahead; what is before is forgotten."""
        for known in [known for known in self._told if known < tick]:
            del self._told[known]
        return [self._tell(tick + ahead, desired_at, body) for ahead in self.policy.ahead.tolist()]

    def _observation(self, look: ReferenceSample, frames: list[Told]) -> SingleArray:
        now, deviation = frames[0], np.empty(len(look.features))
        find_deviation(deviation, look.features, now.features, now.facing, self._centre)
        told = np.array([each.frame for each in frames])
        observation = np.empty(len(deviation) + told.size, np.float32)
        observe(observation, deviation, told, now.facing, self.policy.scales)
        return observation

    def _look(self, state: StampedState, now: Told, body: RolloutModel) -> ReferenceSample:
        """A state in the reference's world."""
        position = self._model.position_of(state.position)
        # A message's array cannot be written to, which is another type to compiled code.
        seen = self.anchor.to_reference_world(position, state.velocity.copy())
        return ReferenceSample(*seen, self._features(*seen, now.position, body))

    def _follow(self, tick: int, look: ReferenceSample, now: Told, soon: Told) -> bool:
        """Have the reference's world give way to a state; whether it moved."""
        rate, before = self._given.rate_hz, self.anchor
        elapsed = 0.0 if self._offset is None else (tick - self._decided) / rate
        seen, wanted, later = (each.planar(self._centre) for each in (look, now, soon))
        self.anchor = before.advanced(seen, wanted, later, tick / rate, elapsed)
        return (self.anchor.place, self.anchor.yaw) != (before.place, before.yaw)

    def _features(
        self, position: FloatArray, velocity: FloatArray, target: FloatArray, body: RolloutModel
    ) -> FloatArray:
        features = np.zeros(self._model.feature_count)
        features_against(features, position, velocity, target, body, self._engine)
        return features

    def _tell(self, tick: int, desired_at: DesiredAt, body: RolloutModel) -> Told:
        if tick not in self._told:
            state = desired_at(tick)
            position = self._model.position_of(state.configuration.position)
            features = self._features(position, state.velocity, position, body)
            frame = np.empty(self.policy.scales.frame_mean.shape[1])
            joints = state.configuration.position[6:].copy()
            write_frame(frame, position, joints, features, self._centre)
            facing = heading(position, self._model.left)
            self._told[tick] = Told(position, state.velocity, features, frame, facing)
        return self._told[tick]

    def _outlook(self, features: FloatArray) -> Outlook:
        """What it expects: a cost of 0 to 1 instead of a plan's."""
        cost = np.clip([1.0 - self.expected], 0.0, 1.0)
        centre = self.anchor.to_world(features[np.newaxis, self._centre : self._centre + 3])
        return Outlook(np.zeros(1), centre, cost, cost, self.anchor)


def _copy_of(made_of: tuple[Character, Policies, PlannerParameters], state: Any) -> object:
    """The copy of a planner that was made of these, in its state."""
    from controller_node.planner.factory import make_commands_in_flight

    (character, _, given), (*own, looked, sent) = made_of, state
    in_flight = None if sent is None else make_commands_in_flight(character, given)
    copy = PolicyPlanner(*made_of, in_flight)
    copy._offset, copy._decided, copy.clip = own
    copy.anchor, copy.outlook, copy.expected = looked
    if in_flight is not None:
        in_flight.restore(sent)
    return copy
