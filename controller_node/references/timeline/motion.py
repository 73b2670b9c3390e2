"""The reference `timeline`: the motion of a timeline's file."""

import pickle

from controller_node.references.base import REFERENCES, Motion, Reference, ReferenceState
from controller_node.references.steering import factory  # noqa: F401  registers what it steers
from controller_node.references.timeline.description import Timeline
from controller_node.references.timeline.file import read_timeline
from controller_node.references.timeline.ground import GroundMaker
from controller_node.references.timeline.layers import layer_of_poses
from controller_node.references.timeline.targets import TargetLayers
from msgs_config.character.model import Character
from msgs_config.memory import OnePart
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter

_MOST_KNOWN = 2048  # states: many more than there are ticks in a planner's horizon


class TimelineSettings(Settings):
    """The timeline that is tracked."""

    timeline: str = parameter(
        "", "name of a shipped timeline, or path of a .yaml file: poses, clips and events in time"
    )


class TimelineReference(OnePart):
    """A timeline's motion. It remembers states, which a planner asks for again and again.

    A controller goes on from a keyframe with an edited timeline in its place.
    """

    def __init__(self, timeline: Timeline, motion: Reference, end: float, still: float) -> None:
        """`end` is when all that the timeline says is over, s; `still`, when it stands then."""
        self.timeline, self.end, self.still = timeline, end, max(end, still)
        self._motion = motion
        self._known: dict[float, ReferenceState] = {}

    def __getstate__(self) -> dict[str, object]:
        """All but the states that are known: they are sampled again."""
        return vars(self) | {"_known": {}}

    def is_motion_of(self, other: "TimelineReference") -> bool:
        """Whether both move alike to the bit; some that do may not be recognised."""
        return pickle.dumps(self._motion) == pickle.dumps(other._motion)

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        state = self._known.get(time)
        if state is None:
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            state = self._known[time] = self._motion.sample(time)
        return state


def timeline_motion(character: Character, values: Values, timeline: Timeline) -> Motion:
    """The motion of a timeline. Raises MotionError if the character cannot do it."""
    maker = GroundMaker(character, values, timeline)
    motion: Reference = maker.make()
    end = maker.end
    for layer in timeline.layers:
        motion = layer_of_poses(character, motion, layer)
        end = max(end, layer.poses[-1].at + (layer.go or 0.0))
    targets = TargetLayers(character)
    for entry in timeline.reaches:
        motion = targets.reach(motion, entry)
    for entry in timeline.looks:
        motion = targets.look(motion, entry)
    end = max([end, *(each.until + each.go for each in (*timeline.reaches, *timeline.looks))])
    clamped = ", ".join(dict.fromkeys(maker.clamped))
    warnings = (f"kept within joint limits: {clamped}",) if clamped else ()
    reference = TimelineReference(timeline, motion, end, maker.still)
    return Motion(reference, (*warnings, *targets.warnings))


@REFERENCES.register("timeline", TimelineSettings)
def _timeline(character: Character, values: Values) -> Motion:
    path = TimelineSettings.of(values).timeline
    return timeline_motion(character, values, read_timeline(path))
