"""What is to be reconstructed: a motion over some time, under a run's parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.wrenches import PlannedPush, parse_push
from controller_node.planner.settings import PREDICTIVE, RECORDED
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ConfigurationError
from sim_node.node_settings import NodeSettings
from sim_node.physics.settings import STEADY_CONTACTS

_PLANNING = {
    "planner": PREDICTIVE,
    "plan.knots": 0.2,  # s
    "plan.samples": 48,
    "plan.rounds": 1,  # the search's other worlds look further
}


@dataclass(frozen=True)
class Problem:
    """A motion and how it is run; small, so that every process can make its own plan of it."""

    character: str
    clip: str
    duration: float  # s
    simulator: Mapping[str, object] = field(default_factory=dict)
    controller: Mapping[str, object] = field(default_factory=dict)
    pushes: tuple[str, ...] = ()  # each as LINK:FX,FY,FZ@S; they come in the search, too

    def __post_init__(self) -> None:
        """Have the world of planned runs in the file as well, for whatever plays it."""
        object.__setattr__(self, "simulator", {**STEADY_CONTACTS, **self.simulator})

    def planned_pushes(self, plan: RunPlan) -> tuple[PlannedPush, ...]:
        """The pushes of its plan. Raises ConfigurationError if one is wrong."""
        return tuple(parse_push(text, plan) for text in self.pushes)

    def check(self) -> RunPlan:
        """Its plan, if it can be searched for; raises ActuatedCharactersError otherwise."""
        plan = self.plan()
        self.planned_pushes(plan)
        if NodeSettings.of(plan.simulator).tick_period:
            raise ConfigurationError(
                "motion reconstruct simulates as fast as it can; it takes neither 'mode' realtime "
                "nor a 'real_time_factor'"
            )
        return plan

    def plan(self) -> RunPlan:
        """The run in which the motion is planned, with one thread.

        Raises:
            ActuatedCharactersError: a name or value is wrong.
        """
        # Unpushed, the clip stays in its own place.
        gives_way = {"plan.gives_way": bool(self.pushes)}
        planning = {**_PLANNING, **gives_way, **self.controller, "plan.workers": 1}
        return self._plan(self.clip, planning)

    def plan_of(self, file: Path) -> RunPlan:
        """The run in which a file's plan is played. Raises ActuatedCharactersError likewise."""
        return self._plan(str(file), self.played_with)

    @property
    def played_with(self) -> dict[str, object]:
        """The controller's parameters with which a file is played."""
        return {**self.controller, "planner": RECORDED}

    def _plan(self, clip: str, controller: Mapping[str, object]) -> RunPlan:
        reference = {"reference": "clip", "clip": clip}
        return make_plan(self.character, self.duration, reference, self.simulator, controller)


def duration_of(character: str, clip: str, cycles: int) -> float:
    """How long some cycles of a clip last, s.

    Raises:
        ActuatedCharactersError: there is no such clip, or it does not go on from its end.
    """
    frames = read_clip(load_character(character), clip)
    if cycles < 1:
        raise ConfigurationError(f"--cycles is {cycles}; it must be 1 or more")
    if cycles > 1 and not frames.wraps:
        raise ConfigurationError(f"--cycles is {cycles}; the clip '{clip}' ends, it must be 1")
    return cycles * float(frames.times[-1])
