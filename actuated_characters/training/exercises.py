"""What a policy is to keep: a clip, or where a driver of all moods steers."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from actuated_characters.runs.brought import bring_parameters
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.velocities import PlannedVelocity, plan_velocities
from controller_node.planner.policy.file import STEERED
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import SteeringLimits
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import ClipFrames, read_clip

_DRIVEN_S = 960.0  # of a drive in which episodes begin
_TRIED_S = 60.0  # of the last runs of what does not end
_STEADY = 1.0  # m/s
_MOOD_S = (1.0, 4.0)  # least and most time for which a driver wants the same
_STOPS, _MANOEUVRES, _BENDS = 0.2, 0.35, 0.5  # shares of moods; of what goes ahead, of bends
_SHARPEST = 1.5  # m/s^2 to the side, that a driver wants
_SHORTEST = 0.1  # s, that a mood lasts at the end
_DIGITS = 1e3  # a velocity's and a time's, rounded to zero, so that none is beyond its limit


@dataclass(frozen=True)
class Exercise:
    """A motion of a character, by its name or file."""

    character: str
    name: str  # a clip's name or file, or `STEERED`

    @property
    def is_steered(self) -> bool:
        """Whether velocities say where it goes."""
        return self.name == STEERED

    @cached_property
    def cycle_s(self) -> float:
        """Time in which episodes begin; raises ActuatedCharactersError if there is no such clip."""
        return _DRIVEN_S if self.is_steered else float(self._frames.times[-1])

    @property
    def wraps(self) -> bool:
        """Whether it goes on from its end."""
        return not self.is_steered and self._frames.wraps

    @property
    def tried_s(self) -> float:
        """Length of a run that tries it."""
        return _TRIED_S if self.is_steered or self.wraps else self.cycle_s

    def options(self, controller: Mapping[str, object]) -> list[str]:
        """Of `run`, so that it plays it; `controller` has the controller's parameters."""
        if not self.is_steered:
            return ["--clip", self.name]
        reference = self.plan(1.0, {}, controller, 0)[0].reference
        assert isinstance(reference, SteeredReference)
        return ["--cmd-vel", f"{min(_STEADY, reference.limits.speed):g},0,0@0"]

    def plan(
        self,
        seconds: float,
        simulator: Mapping[str, object],
        controller: Mapping[str, object],
        seed: int,
    ) -> tuple[RunPlan, list[PlannedVelocity]]:
        """A run of it, and the velocities to send; `seed` says where it is steered.

        A reconstructed clip brings the parameters that it was found with. How long a command holds
        does not matter to a drive, which gives each once.

        Raises:
            ActuatedCharactersError: a name or a value is wrong.
        """
        if not self.is_steered:
            simulator, controller = dict(simulator), dict(controller)
            bring_parameters(load_character(self.character), self.name, simulator, controller)
            motion = {"reference": "clip", "clip": self.name}
            return make_plan(self.character, seconds, motion, simulator, controller), []
        lasting = {**controller, "steering.timeout": seconds}
        plan = make_plan(self.character, seconds, {"reference": STEERED}, simulator, lasting)
        assert isinstance(plan.reference, SteeredReference)
        return plan_velocities(plan, random_drive(plan.reference.limits, seconds, seed))

    @cached_property
    def _frames(self) -> ClipFrames:
        return read_clip(load_character(self.character), self.name)


def random_drive(limits: SteeringLimits, seconds: float, seed: int) -> str:
    """Velocities as `--cmd-vel` takes them: ahead at any speed, bends, stops, but no two in a row.

    And manoeuvres: slowly ahead or back, aside, and turning, each of these or not.
    """
    rng, time, drive = np.random.default_rng((seed, 7)), 0.0, list[str]()
    velocity = (0.0, 0.0, 0.0)
    ahead = min(limits.region.ahead, limits.speed)
    back, aside = (min(each, limits.speed) for each in (limits.region.back, limits.region.aside))
    turn = min(limits.turn_rate, limits.region.turn)
    while time == 0.0 or time < seconds - _SHORTEST:
        mood, stood, velocity = rng.random(), not any(velocity), (0.0, 0.0, 0.0)
        if stood:
            mood = _STOPS + (1.0 - _STOPS) * mood
        if mood > 1.0 - _MANOEUVRES:
            parts = rng.uniform(-1.0, 1.0, 3) * rng.integers(0, 2, 3)
            velocity = back * parts[0], aside * parts[1], turn * parts[2]
        elif mood > _STOPS:
            speed = rng.uniform(0.0, ahead)
            most = min(turn, _SHARPEST / max(speed, 1e-3))
            velocity = speed, 0.0, rng.uniform(-most, most) * (rng.random() < _BENDS)
        rounded = [math.trunc(each * _DIGITS) / _DIGITS for each in (*velocity, time)]
        drive.append("{:g},{:g},{:g}@{:g}".format(*rounded))
        time += rng.uniform(*_MOOD_S)
    return " ".join(drive)
