"""Runs some inputs of a recorded run, and says whether its character falls; leaves no bag."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from actuated_characters.bags.recording import Recording
from actuated_characters.fork.inputs import Stop, Stops
from actuated_characters.fork.node import ForkNode
from actuated_characters.fork.script import Script
from actuated_characters.replay.comparison import first_tick_of
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.pins import PlannedPin
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.velocities import PlannedVelocity
from actuated_characters.runs.planned.wrenches import PlannedPush
from actuated_characters.runs.until_fall import Ended, Keyframe, Sender, run_until_fall
from actuated_characters.shrink.inputs import Event, Request, Setting
from msgs_config.messages import topics

_KEYFRAME_PERIOD = 0.25  # s


@dataclass(frozen=True)
class TrialSetting:
    """What all trials have in common."""

    recording: Recording
    plan: RunPlan  # whose files have the recorded texts, see `with_files`
    ticks: int  # at whose end a trial ends
    folder: Path  # where keyframes are written for the nodes that read them

    def row_of(self, keyframe: Keyframe | None) -> int:
        """The recording's row in whose state a trial goes on."""
        return 0 if keyframe is None else keyframe.tick - first_tick_of(self.recording)


def script_of(
    recording: Recording, events: Iterable[Event], *, begin: int = 0, compared: int = -1
) -> Script:
    """The script that sends events in a run that begins with a row's state.

    What was sent before is in the keyframe of that state. The states up to a row are compared with
    the recorded ones, none at -1.
    """
    stops: Stops = defaultdict(Stop)
    requests: dict[int, list[tuple[str, bytes]]] = defaultdict(list)
    for event in events:
        row, content = event.stop - begin, event.content
        if begin and row <= 0:
            continue
        match content:
            case PlannedPush():
                stops[row].pushes.append(content)
            case PlannedPin():
                stops[row].pins.append(content)
            case PlannedThrow():
                stops[row].throws.append(content)
            case PlannedVelocity():
                requests[row].append((topics.CMD_VEL_STAMPED.name, content.encode()))
            case Setting(name, value):
                stops[row].settings.append((topics.CONTROLLER_NODE, {name: value}))
            case Request(topic, raw):
                requests[row].append((topic, raw))
    return Script(recording, first_tick_of(recording) + begin, compared, stops, requests)


def run_trial(
    setting: TrialSetting, events: Sequence[Event], begin: Keyframe | None, *, compared: int = -1
) -> Ended:
    """Run events from a keyframe on, or from the start, until it has fallen, or the last tick.

    The states up to a row are compared with the recorded ones, none at -1.

    Raises:
        ReplayError: one of these is another one.
        ActuatedCharactersError: one of the nodes failed.
    """
    recording, row = setting.recording, setting.row_of(begin)
    script = script_of(recording, events, begin=row, compared=compared)
    return run_until_fall(
        setting.plan.lasting(setting.ticks - row),
        Sender("fork", partial(ForkNode, script=script), {}),
        setting.folder,
        begin=begin,
        first_tick=first_tick_of(recording),
        keyframe_period=_KEYFRAME_PERIOD,
        changed=_changed_before(events, row),
    )


def _changed_before(events: Iterable[Event], row: int) -> dict[str, object]:
    """The parameters that were changed before the answer to a row's state."""
    return {
        event.content.name: event.content.value
        for event in events
        if isinstance(event.content, Setting) and event.stop <= row and row
    }
