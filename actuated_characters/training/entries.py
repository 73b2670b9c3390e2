"""How a motion begins elsewhere: where another clip ends, or where a fall does.

A behaviour goes over to a motion from wherever it is: to walking from the end of a get-up, at any
moment of a step, or to a get-up from how a limp body has come to lie. Episodes that begin in the
motion itself know nothing of that.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from actuated_characters.runs.plan import RunPlan
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.references import TrainedReference
from controller_node.behaviours.motion_library import MotionLibrary
from controller_node.behaviours.reaction_factory import LYING_PART
from controller_node.behaviours.settings import ReactionSettings
from controller_node.behaviours.targets import ClipTarget
from controller_node.control_laws import GainArrays
from controller_node.planner.compiled.rollout import let_act
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.settings import PlannerParameters
from controller_node.references.base import ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.posture import Posture
from controller_node.references.transformed import PlanarTransform, TransformedReference
from controller_node.tracked_reference import TrackedReference
from msgs_config.arrays import FloatArray
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ConfigurationError
from msgs_config.messages.clock import TickClock

FALL = "fall"
"""What a get-up comes after, in the place of a clip's name."""
_COUNT = 32  # entries after one clip, or falls
_FALL_S = 3.0  # until a limp body lies
_KICK, _SPIN = 1.5, 2.0  # m/s and rad/s, with which it falls, standard deviation


class Entries:
    """The entries of an exercise, of which a plan has motion and parameters."""

    def __init__(
        self, exercise: Exercise, plan: RunPlan, seed: int, *, follows_velocity: bool = True
    ) -> None:
        """`follows_velocity` says whether the reference's velocity is tracked, rather than zero."""
        self._exercise, self._plan = exercise, plan
        self._follows_velocity = follows_velocity
        self._layout = plan.character.layout
        self._settings = ReactionSettings.of(plan.controller)
        self._posture = Posture(plan.character)
        self._rng = np.random.default_rng((seed, 11))

    def after(self, name: str) -> list[TrainedReference]:
        """Entries after a clip, or after falls; together they weigh as much as the motion.

        Raises:
            ActuatedCharactersError: there is no such clip; or the motion does not begin lying, or
                on a side on which no fall ends.
        """
        found = list(self._after_falls() if name == FALL else self._after_clip(name))
        if not found:
            raise ConfigurationError(
                f"--after {FALL}: no fall ends on the side on which {self._exercise.name} begins"
            )
        return [replace(each, weight=1.0 / len(found)) for each in found]

    def _after_clip(self, name: str) -> Iterator[TrainedReference]:
        """At random moments of the motion, from the last state of a clip."""
        frames = read_clip(self._plan.character, name)
        end = ClipReference(self._layout, frames).sample(float(frames.times[-1]))
        lasts = self._settings.blend_duration
        for moment in self._rng.uniform(0.0, self._exercise.cycle_s, _COUNT).tolist():
            own = self._plan.reference.sample(moment)
            carry = self._posture.carry(own.configuration, end.configuration)
            yield self._entry(carry, moment, end, lasts, lasts)

    def _after_falls(self) -> Iterator[TrainedReference]:
        """At the moment that is nearest to how a body lies, if on the side on which it begins."""
        name, layout = self._exercise.name, self._layout
        first, still = self._plan.reference.sample(0.0).configuration, np.zeros(layout.size)
        rest = layout.configuration(np.array(self._plan.character.rest_position))
        if not self._posture.has_fallen(first, rest):
            raise ConfigurationError(
                f"--after {FALL} is for clips that begin lying; {name} begins standing"
            )
        library = MotionLibrary(self._plan.character, [name], lasting=0.0, share=LYING_PART)
        side = self._posture.faces_up(first.orientations_xyzw[0])
        for position in self._lying():
            lies = layout.configuration(position)
            if self._posture.faces_up(lies.orientations_xyzw[0]) != side:
                continue
            match = library.nearest(library.predicted(position, still))
            there = self._plan.reference.sample(match.time).configuration.position
            carry = PlanarTransform.leading(there, 0.0, position, match.turn)
            body = ReferenceState(lies, still, still)
            left = self._exercise.cycle_s - match.time
            yield self._entry(carry, match.time, body, self._settings.recovery_duration, left)

    def _lying(self) -> Iterator[FloatArray]:
        """Positions (n,) of bodies that went limp somewhere in the motion, and fell."""
        plan, size = self._plan, self._layout.size
        given = PlannerParameters.of(plan.controller)
        model, nothing = ContactModel.of(plan.character, given), np.zeros(size)
        engine = model.engine()
        limp = model.body(GainArrays(nothing, nothing, nothing, plan.character.effort_limits()))
        ticks = round(_FALL_S * given.rate_hz)
        for moment in self._rng.uniform(0.0, self._exercise.cycle_s, 2 * _COUNT).tolist():
            state = plan.reference.sample(moment)
            velocity = state.velocity.copy()
            velocity[:2] += _KICK * self._rng.normal(size=2)
            velocity[3:6] += _SPIN * self._rng.normal(size=3)
            start = model.position_of(state.configuration.position)
            if let_act(start, velocity, np.zeros((ticks, size)), limp, engine):
                yield model.message_position(engine.position)

    def _entry(
        self,
        carry: PlanarTransform,
        moment: float,
        begin: ReferenceState,
        blend_s: float,
        lasts_s: float,
    ) -> TrainedReference:
        """From a state over to a moment of the motion, carried, as a behaviour's target goes."""
        plan = self._plan
        motion = TransformedReference(self._layout, plan.reference, carry, 0.0, moment)
        clock = TickClock(plan.simulation.rate_hz)
        tracked = TrackedReference(plan.character, plan.reference, clock, episode_ns=0)
        tracked.follows_velocity = self._follows_velocity
        tracked.target = ClipTarget.entered(self._exercise.name, motion, begin, 0.0, blend_s)
        return TrainedReference(tracked, blend_s, wraps=False, lasts_s=lasts_s)
