"""The behaviour `pursuit`: an active ragdoll that goes for another character of its world.

    TRACK, towards the opponent -> BLEND (a strike, where it is in reach) -> BLEND (back) -> TRACK
    any of them -> LIMP -> SEARCH -> BLEND (getting up) -> TRACK

The lecture's root force draws it, its root torque turns it and keeps it upright; both are bounded,
by the effort limit of the root and by `upright.torque`.

Source: Reynolds 1999, "Steering Behaviors for Autonomous Characters": seek, and flee.
"""

import math

import numpy as np

from controller_node.behaviours.base import BehaviourOutput, Mode, Observation
from controller_node.behaviours.hit_detection import Hit
from controller_node.behaviours.motion_library import MotionLibrary
from controller_node.behaviours.reaction import Reaction, ReactionKit
from controller_node.behaviours.targets import ClipTarget
from controller_node.planner.settings import NO_PLANNER, PlannerParameters
from controller_node.references.transformed import PlanarTransform, TransformedReference
from msgs_config.character.model import Character
from msgs_config.clips.reading import available_clips
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter

_TURN_SPEED = 3.0  # rad/s, of the target's heading at most
_STANDING_HEIGHT = 0.8  # share of the own reference's root height: an opponent below it is down
_CLEARANCE = 2.0  # m, to which it goes away from an opponent that is down
_MIN_DISTANCE = 1e-3  # m; nearer than that no way leads to the opponent
_ONTO = 0.3  # s, until a strike's motion is reached


class PursuitSettings(Settings):
    """How an opponent is gone for."""

    opponent: str = parameter(
        "", "pursuit: the character that it goes for, by its name in the world"
    )
    force: float = parameter(
        400.0,
        "pursuit: root force towards the opponent, within the effort limit of the root",
        name="pursuit.force",
        unit="N",
    )
    reach: float = parameter(
        0.9, "pursuit: it strikes where the roots are so near", name="strike.reach", unit="m"
    )
    strikes: tuple[str, ...] = parameter(
        (), "pursuit: clips to strike with, in turn; none named: none", name="strike.clips"
    )


def pursuit_settings(character: Character, values: Values) -> PursuitSettings:
    """The settings that the parameters' values say.

    Raises:
        ConfigurationError: there is no opponent, or a planner; or a clip does not exist.
    """
    settings = PursuitSettings.of(values)
    if not settings.opponent:
        raise ConfigurationError(
            "parameter 'behaviour' is pursuit, which needs an 'opponent': another of several "
            "'characters' of sim_node"
        )
    if PlannerParameters.of(values).planner != NO_PLANNER:
        raise ConfigurationError(
            "parameter 'behaviour' is pursuit, whose way no planner can foresee; 'planner' must be "
            f"{NO_PLANNER}"
        )
    clips = available_clips(character)
    for clip in settings.strikes:
        if clip not in clips:
            raise ConfigurationError(one_of("clip in parameter 'strike.clips':", clip, clips))
    return settings


class Pursuit(Reaction):
    """The state machine of `pursuit`, for one episode."""

    def __init__(
        self, kit: ReactionKit, settings: PursuitSettings, strikes: MotionLibrary | None
    ) -> None:
        """`strikes` has the clips of the settings; None: it does not strike."""
        super().__init__(kit)
        self._pursuit, self._strikes = settings, strikes
        self._strike_count = 0
        self._heading: float | None = None  # rad, of the target while it goes for the opponent

    def advance(self, seen: Observation) -> BehaviourOutput:
        """As an active ragdoll, with the own reference where the opponent draws it."""
        output = super().advance(seen)
        if self._target is self._own:  # the object of the own reference, not one that equals it
            self.carry = self._drawn(seen)
        else:
            self._heading = None
        return output

    def _track(self, seen: Observation, hit: Hit | None) -> None:
        super()._track(seen, hit)
        way = self._way(seen)
        in_reach = _length(way) <= self._pursuit.reach and not self._is_down(seen)
        if self._phase.mode is Mode.TRACK and self._strikes is not None and in_reach:
            self._strike(seen, self._strikes, math.atan2(way[1], way[0]))

    def _strike(self, seen: Observation, library: MotionLibrary, heading: float) -> None:
        """Go over to the next strike, with a heading in rad."""
        clip = self._pursuit.strikes[self._strike_count % len(self._pursuit.strikes)]
        self._strike_count += 1
        motion = library.references[clip]
        first = motion.sample(0.0).configuration
        start = float(self._kit.posture.heading(first.orientations_xyzw[0]))
        carry = self._on_ground(
            PlanarTransform.leading(first.position[:3], start, seen.position[:3], heading)
        )
        moved = TransformedReference(self._layout, motion, carry, seen.time)
        self._target = ClipTarget.entered(clip, moved, self._desired(seen), seen.time, _ONTO)
        self._strike_until = seen.time + library.duration(clip)
        facts = {"to": "clip", "assistance": seen.assistance(), "clip": clip}
        self._begin(seen.time, Mode.BLEND, self._go_on_striking, self._phase_gains.firm, **facts)

    def _go_on_striking(self, seen: Observation, hit: Hit | None) -> None:
        if seen.time >= self._strike_until:
            carry = self._carry_to(seen, self._desired(seen))
            self._come_back(seen, carry, self._kit.settings.blend_duration)
        self._track(seen, hit)

    def _way(self, seen: Observation) -> tuple[float, float]:
        """The way to the opponent, m, world; ahead if it is here."""
        assert seen.opponent is not None
        x, y = (seen.opponent - seen.position[:3])[:2].tolist()
        return (x, y) if _length((x, y)) > _MIN_DISTANCE else (_MIN_DISTANCE, 0.0)

    def _is_down(self, seen: Observation) -> bool:
        """Whether the opponent lies, or is yet to stand up."""
        assert seen.opponent is not None
        height = float(seen.opponent[2]) - self._kit.ground_below(seen.opponent)
        return height < _STANDING_HEIGHT * float(seen.now.configuration.position[2])

    def _drawn(self, seen: Observation) -> PlanarTransform:
        """The move of the reference to ahead of the body, with a heading to the opponent.

        So far ahead that the root's stiffness times it is the force of the settings. The heading
        is away from an opponent that is down, and near.
        """
        x, y = way = self._way(seen)
        distance = _length(way)
        if self._is_down(seen) and distance < _CLEARANCE:
            x, y = -x, -y
        posture, own = self._kit.posture, seen.now.configuration
        if self._heading is None:
            self._heading = float(posture.heading(self._body.configuration.orientations_xyzw[0]))
        turn = math.remainder(math.atan2(y, x) - self._heading, math.tau)
        most = _TURN_SPEED * self._kit.period
        self._heading += min(max(turn, -most), most)
        stiffness = float(seen.gains.stiffness[0])
        ahead = self._pursuit.force / (stiffness * distance) if stiffness > 0.0 else 0.0
        place = seen.position[:3] + np.array((ahead * x, ahead * y, 0.0))
        start = float(posture.heading(own.orientations_xyzw[0]))
        carry = PlanarTransform.leading(own.position[:3], start, place, self._heading)
        return self._on_ground(carry)


def _length(way: tuple[float, float]) -> float:
    return math.sqrt(way[0] * way[0] + way[1] * way[1])  # the same bits with any Python
