"""Physics and captured motion in turn: tracks, gives way to a hit, and comes back.

    TRACK -> REACT -> SEARCH -> BLEND (to the motion found) -> BLEND (back) -> TRACK
    REACT, or TRACK -> LIMP -> SEARCH -> BLEND (getting up) -> TRACK

Source: Zordan, Majkowska, Chiu and Fast 2005, "Dynamic Response for Motion Capture Animation".
The target of the control law is continuous in position and velocity at each change.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from controller_node.behaviours.asked import UNASKED, Ask
from controller_node.behaviours.base import BehaviourOutput, Mode, Observation, Phase
from controller_node.behaviours.compliance import ReactionGains
from controller_node.behaviours.hit_detection import WINDOW, Hit, HitDetector
from controller_node.behaviours.motion_library import Match, MotionLibrary
from controller_node.behaviours.settings import ReactionSettings
from controller_node.behaviours.targets import (
    ClipTarget,
    CurrentStateTarget,
    ReferenceTarget,
    Target,
)
from controller_node.control_laws import GainArrays
from controller_node.ground import Terrain
from controller_node.references.base import ReferenceState
from controller_node.references.inertialised import InertializationOffset
from controller_node.references.posture import Posture
from controller_node.references.steering.velocity import within
from controller_node.references.transformed import PlanarTransform, TransformedReference
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.geometry import rotations

_SEVERE = 2.0 / 3.0  # share of `limp.threshold`: from there on a hit has the full reaction
_ONTO = 0.6  # share of the blend's duration until the motion that was found is reached
_STILL_SPEED = 0.1  # m/s: it lies still with less kinetic energy than all of it at that speed
_STILL_TIME, _LONGEST_LIMP = 0.4, 5.0  # s
_CLIMB = 0.5  # m/s, at most, by which references follow the height of the ground


@dataclass(frozen=True)
class ReactionKit:
    """The parts that all episodes of one controller share."""

    character: Character
    settings: ReactionSettings
    model: DynamicsModel
    posture: Posture
    period: float  # control period, s
    library: MotionLibrary | None = None  # where a behaviour searches
    get_ups: MotionLibrary | None = None  # where a behaviour finds a clip to get up by
    plans: bool = False  # a planner counts with the gains in force for as far as it looks
    terrain: Terrain | None = None  # that there is instead of the plane z = 0

    def ground_below(self, place: FloatArray) -> float:
        """The height in m of the ground below a place (3,) in m; 0 where is none."""
        return 0.0 if self.terrain is None else self.terrain.height_below(place)


_Step = Callable[[Observation, Hit | None], None]


class Reaction:
    """The state machine of `reactive` and `active_ragdoll`, for one episode."""

    def __init__(self, kit: ReactionKit) -> None:
        self._kit = kit
        self._layout = kit.character.layout
        self._settings = kit.settings
        surfaces = None if kit.terrain is None else kit.terrain.surfaces
        self._detector = HitDetector(kit.character, kit.period, terrain=surfaces)
        self._up = 0.0  # m that the target is lifted, as the ground is
        self._phase_gains = ReactionGains(kit.character, kit.settings, kit.model.weight, kit.plans)
        self._own = ReferenceTarget(self._layout)
        self._target: Target = self._own
        self._asked = UNASKED
        self._hit = Hit(0, 0.0)  # the hit that was reacted to last
        self._begin(0.0, Mode.TRACK, self._begin_tracking, self._phase_gains.firm)

    @property
    def carry(self) -> PlanarTransform:
        """Of the own reference, to where the character goes on with it."""
        return self._own.carry

    @carry.setter
    def carry(self, carry: PlanarTransform) -> None:
        self._own.carry = carry

    def advance(self, seen: Observation) -> BehaviourOutput:
        """Change the phase if it is time, and return its target and gains."""
        self._kit.model.update(seen.position, seen.velocity)
        hit = self._detector.strongest(seen.contacts, *self._kit.model.link_poses())
        still = np.zeros(self._layout.size)
        self._body = ReferenceState(self._layout.configuration(seen.position), seen.velocity, still)
        self._follow_ground(seen.position[:3])
        if not self._gets_up_now(seen):
            self._step(seen, hit)
        return BehaviourOutput(self._phase, self._target, self._gains(seen, self._elapsed(seen)))

    def _follow_ground(self, place: FloatArray) -> None:
        """Lift the own reference by the height of the ground below the body, not all at once."""
        if self._kit.terrain is None:
            return
        is_tracked = not isinstance(self._target, CurrentStateTarget)
        most = _CLIMB * self._kit.period if is_tracked else math.inf
        self._up += within(self._kit.ground_below(place) - self._up, most)
        self.carry = self._on_ground(self.carry)

    def _gets_up_now(self, seen: Observation) -> bool:
        """Begin to get up where that was asked for in this tick, and it lies."""
        is_new, self._asked = seen.asked != self._asked, seen.asked
        if not is_new or seen.asked.ask is not Ask.GET_UP:
            return False
        if self._phase.mode is Mode.TRACK and self._has_fallen(seen):
            self._go_limp(seen, "asked", None)
        if not isinstance(self._target, CurrentStateTarget):
            return False
        self._target.state = self._body
        self._prepare_get_up(seen)
        return True

    def _begin(
        self,
        time: float,
        mode: Mode,
        step: _Step,
        gains: Callable[[Observation, float], GainArrays],
        **facts: object,
    ) -> None:
        """Begin a phase with the step that may end it and the gains that hold in it."""
        self._phase = Phase(mode, facts)
        self._since, self._step, self._gains = time, step, gains

    def _elapsed(self, seen: Observation) -> float:
        return seen.time - self._since

    def _desired(self, seen: Observation) -> ReferenceState:
        """The state that the present target has."""
        return self._target.state_at(seen.time, seen.now)

    # The step of each phase

    def _begin_tracking(self, seen: Observation, hit: Hit | None) -> None:
        assistance = seen.assistance()
        self._begin(
            seen.time, Mode.TRACK, self._track, self._phase_gains.firm, assistance=assistance
        )
        self._track(seen, hit)

    def _track(self, seen: Observation, hit: Hit | None) -> None:
        """Give way to a hit, or go limp by a hard one or having fallen, as it is asked to."""
        if seen.asked.ask in (Ask.TRACK, Ask.BRACE):
            return
        if seen.asked.ask is Ask.GET_UP:
            hit = None
        if hit is not None and hit.impulse >= self._settings.limp_threshold:
            self._go_limp(seen, "hit", hit)
        elif (
            hit is not None
            and hit.impulse >= self._settings.hit_threshold
            and self._settings.searches
        ):
            self._react(seen, hit)
        elif self._has_fallen(seen):
            self._go_limp(seen, "fallen", None)

    def _return(self, seen: Observation, hit: Hit | None) -> None:
        if self._elapsed(seen) >= self._settings.blend_duration:
            self._target = self._own = ReferenceTarget(self._layout, self._own.carry)
            self._begin_tracking(seen, hit)
        else:
            self._track(seen, hit)

    def _blend(self, seen: Observation, hit: Hit | None) -> None:
        if self._elapsed(seen) >= self._settings.blend_duration:
            self._come_back(seen, self._own.carry, self._settings.blend_duration)
        self._track(seen, hit)

    def _react_on(self, seen: Observation, hit: Hit | None) -> None:
        if hit is not None and hit.impulse > self._hit.impulse:
            self._hit = hit  # the impulse grows while the contact lasts
        if self._hit.impulse >= self._settings.limp_threshold:
            self._go_limp(seen, "hit", self._hit)
        elif self._has_fallen(seen):
            self._go_limp(seen, "fallen", self._hit)
        elif self._elapsed(seen) >= max(self._severity * self._settings.react_duration, WINDOW):
            facts = self._hit_facts(seen)
            self._begin(seen.time, Mode.SEARCH, self._search, self._phase_gains.soft, **facts)

    def _search(self, seen: Observation, hit: Hit | None) -> None:
        """Go on with the motion that is nearest to what the present state leads to."""
        library = self._kit.library
        assert library is not None
        self._detector.reset()  # forget the hit that was reacted to
        match = library.nearest(library.predicted(self._above(self._led(seen)), seen.velocity))
        self._follow_clip(library, match, seen, _ONTO * self._settings.blend_duration)
        facts = {"to": "clip", "assistance": seen.assistance(), **match.content()}
        self._begin(seen.time, Mode.BLEND, self._blend, self._phase_gains.firmer, **facts)

    def _lie(self, seen: Observation, hit: Hit | None) -> None:
        """Wait until the character lies still."""
        assert isinstance(self._target, CurrentStateTarget)
        self._target.state = self._body
        still_energy = 0.5 * self._kit.character.mass * _STILL_SPEED * _STILL_SPEED
        if self._kit.model.kinetic_energy() > still_energy:
            self._moved = seen.time
        still = seen.time - self._moved >= _STILL_TIME
        if still or self._elapsed(seen) >= _LONGEST_LIMP:
            self._prepare_get_up(seen)

    def _prepare_get_up(self, seen: Observation) -> None:
        facts = {"side": "faceup" if self._faces_up() else "facedown", "assistance": "none"}
        self._begin(seen.time, Mode.SEARCH, self._find_get_up, self._phase_gains.limp, **facts)

    def _find_get_up(self, seen: Observation, hit: Hit | None) -> None:
        assert isinstance(self._target, CurrentStateTarget)
        self._detector.reset()
        self._target.state = self._body
        library, duration = self._kit.get_ups, self._settings.recovery_duration
        facts: dict[str, object] = {"to": "reference", "assistance": seen.assistance("rising")}
        self._rise_until = seen.time + duration
        if library is None:
            self._come_back(seen, self._carry_to(seen, self._body), duration)
        else:
            clip = self._settings.face_up if self._faces_up() else self._settings.face_down
            still = library.predicted(self._above(seen.position), np.zeros_like(seen.velocity))
            match = library.nearest(still, among=clip)
            self._follow_clip(library, match, seen, duration)
            self._rise_until = seen.time + library.duration(clip) - match.time
            facts |= {"to": "clip", **match.content()}
        self._begin(seen.time, Mode.BLEND, self._rise, self._phase_gains.rising, **facts)

    def _rise(self, seen: Observation, hit: Hit | None) -> None:
        is_hard = hit is not None and hit.impulse >= self._settings.limp_threshold
        if is_hard and seen.asked.ask is Ask.REACT:
            self._go_limp(seen, "hit", hit)
        elif seen.time >= self._rise_until:
            if isinstance(self._target, ClipTarget):
                carry = self._carry_to(seen, self._desired(seen))
                self._come_back(seen, carry, self._settings.blend_duration)
            else:
                self._return(seen, hit)

    # Changes

    def _react(self, seen: Observation, hit: Hit) -> None:
        self._hit = hit
        self._lead = self._layout.difference(
            self._body.configuration, self._desired(seen).configuration
        )
        self._phase_gains.give_way(hit.link, np.diag(self._kit.model.mass_matrix()))
        self._begin(
            seen.time, Mode.REACT, self._react_on, self._phase_gains.soft, **self._hit_facts(seen)
        )

    @property
    def _severity(self) -> float:
        """How hard the hit is, as a share: of light ones the reaction is short and slight.

        Else the pause in assistance would move the character more than the hit itself does.
        """
        return min(self._hit.impulse / (_SEVERE * self._settings.limp_threshold), 1.0)

    def _hit_facts(self, seen: Observation) -> dict[str, object]:
        share = seen.assistance(self._settings.assistance)
        return {**self._facts_of(self._hit), "assistance": share}

    def _facts_of(self, hit: Hit) -> dict[str, object]:
        name = self._kit.character.links[hit.link].name
        return {"link": name, "impulse": hit.impulse}

    def _go_limp(self, seen: Observation, why: str, hit: Hit | None) -> None:
        """Let everything go; the target comes to the body, which nothing draws to it."""
        offset = InertializationOffset(
            self._layout, self._body, self._desired(seen), seen.time, _STILL_TIME
        )
        self._target = CurrentStateTarget(self._body, offset)
        self._moved = seen.time
        self._lead = np.zeros(self._layout.size)
        facts = {} if hit is None else self._facts_of(hit)
        self._begin(
            seen.time,
            Mode.LIMP,
            self._lie,
            self._phase_gains.limp,
            assistance="none",
            why=why,
            **facts,
        )

    def _follow_clip(
        self, library: MotionLibrary, match: Match, seen: Observation, duration: float
    ) -> None:
        """Go over to a moment of a clip, carried to where the character is."""
        motion = library.references[match.clip]
        place = motion.sample(match.time).configuration.position
        carry = self._on_ground(PlanarTransform.leading(place, 0.0, self._led(seen), match.turn))
        moved = TransformedReference(self._layout, motion, carry, seen.time, match.time)
        before = self._desired(seen)
        self._target = ClipTarget.entered(match.clip, moved, before, seen.time, duration)

    def _come_back(self, seen: Observation, carry: PlanarTransform, duration: float) -> None:
        """Go over to the own reference, carried."""
        own = carry.moved(self._layout, seen.now)
        offset = InertializationOffset(self._layout, own, self._desired(seen), seen.time, duration)
        self._target = self._own = ReferenceTarget(self._layout, carry, offset)
        facts = {"to": "reference", "assistance": seen.assistance()}
        self._begin(seen.time, Mode.BLEND, self._return, self._phase_gains.firm, **facts)

    # Places

    def _led(self, seen: Observation) -> FloatArray:
        """The position (n,), led by as much as the target led it when it was struck.

        A body lags behind what it tracks. Without that, a motion found by the body's own state
        would be one that it lags behind once more.
        """
        entries = self._layout.rotation_entries
        position = seen.position + self._lead
        turns = self._body.configuration.orientations_xyzw
        turned = rotations.multiply(turns, rotations.exp(self._lead[entries]))
        position[entries] = rotations.log(turned)
        return position

    def _carry_to(self, seen: Observation, there: ReferenceState) -> PlanarTransform:
        """The move from the root of the reference to that of a state."""
        carry = self._kit.posture.carry(seen.now.configuration, there.configuration)
        return self._on_ground(carry)

    def _on_ground(self, carry: PlanarTransform) -> PlanarTransform:
        """A move that also lifts."""
        return replace(carry, up=self._up)

    def _above(self, position: FloatArray) -> FloatArray:
        """A position (n,) as it would be over the plane z = 0."""
        lowered = position.copy()
        lowered[2] -= self._up
        return lowered

    def _faces_up(self) -> bool:
        return self._kit.posture.faces_up(self._body.configuration.orientations_xyzw[0])

    def _has_fallen(self, seen: Observation) -> bool:
        body, desired = self._body.configuration, self._desired(seen).configuration
        return self._kit.posture.has_fallen(body, desired, self._up)
