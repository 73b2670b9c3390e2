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
from actuated_characters.metrics.collector import MetricsCollector
from actuated_characters.replay.comparison import clock_of, first_tick_of
from actuated_characters.replay.players.character_files import write_keyframe
from actuated_characters.runs.held_signals import signals_held
from actuated_characters.runs.in_process import run_made
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.pins import PlannedPin
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.velocities import PlannedVelocity
from actuated_characters.runs.planned.wrenches import PlannedPush
from actuated_characters.shrink.inputs import Event, Request, Setting
from msgs_config.bus.composition import UNTIL_A_MESSAGE, ComposableNode, Turns
from msgs_config.bus.in_process import Bus, InProcessNode
from msgs_config.bus.node import Executor, StopFlag
from msgs_config.errors import RunError
from msgs_config.messages import topics
from msgs_config.messages.keyframe import decode_keyframe
from msgs_config.messages.session import SESSION, make_session
from msgs_config.shared_parameters import KEYFRAME_BUDGET, KEYFRAME_PERIOD, RESUME_FROM

_LOOK_TICKS = 24  # between looks at whether it has fallen
_KEYFRAMES = {KEYFRAME_PERIOD.name: 0.25, KEYFRAME_BUDGET.name: 5_000}  # s; kB/s
_SUBSCRIBERS = 3  # of states and torques: the other node, who sends, and who looks
_KEYFRAME = topics.KEYFRAME.of(topics.SIM_NODE)
_CONTROLLER_KEYFRAME = topics.CONTROLLER_KEYFRAME.of(topics.CONTROLLER_NODE)


@dataclass(frozen=True)
class Keyframe:
    """All that a run goes on from in the state of a row."""

    row: int
    simulator: bytes
    controller: bytes

    @property
    def size(self) -> int:
        """In bytes."""
        return len(self.simulator) + len(self.controller)


@dataclass(frozen=True)
class Outcome:
    """What a trial has shown."""

    fell: bool
    keyframes: Sequence[Keyframe]  # of states in which it was not down


@dataclass(frozen=True)
class TrialSetting:
    """What all trials have in common."""

    recording: Recording
    plan: RunPlan  # whose files have the recorded texts, see `with_files`
    ticks: int  # at whose end a trial ends
    folder: Path  # where keyframes are written for the nodes that read them


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
) -> Outcome:
    """Run events from a keyframe on, or from the start, until it has fallen, or the last tick.

    The states up to a row are compared with the recorded ones, none at -1.

    Raises:
        ReplayError: one of these is another one.
        ActuatedCharactersError: one of the nodes failed.
    """
    recording, row = setting.recording, 0 if begin is None else begin.row
    script = script_of(recording, events, begin=row, compared=compared)
    session = {SESSION.name: make_session("/sim_node")}
    controller: dict[str, object] = {**setting.plan.controller, **session, **_KEYFRAMES}
    controller |= _changed_before(events, row)
    simulator: dict[str, object] = {**setting.plan.simulator, **session, **_KEYFRAMES}
    simulator["max_ticks"] = setting.ticks - row
    if begin is not None:
        for given, node, raw in (
            (simulator, topics.SIM_NODE, begin.simulator),
            (controller, topics.CONTROLLER_NODE, begin.controller),
        ):
            given[RESUME_FROM.name] = write_keyframe(setting.folder, node, raw)
    awaited = {"wait_for_subscribers": _SUBSCRIBERS}
    bus = Bus(lambda name, severity, sentence: None)
    listener = TrialListener(bus.node("listener", {}))
    places = [
        bus.node("fork", session),
        bus.node(topics.CONTROLLER_NODE, {**controller, **awaited}),
        bus.node(topics.SIM_NODE, {**simulator, **awaited}),
    ]
    with signals_held(most=2) as stop:
        run_made(listener, places, {"fork": partial(ForkNode, script=script)}, stop)
    if stop:
        raise KeyboardInterrupt
    return listener.outcome(recording, row)


def _changed_before(events: Iterable[Event], row: int) -> dict[str, object]:
    """The parameters that were changed before the answer to a row's state."""
    return {
        event.content.name: event.content.value
        for event in events
        if isinstance(event.content, Setting) and event.stop <= row and row
    }


class TrialListener(ComposableNode):
    """Measures a run as a recorder does, keeps its keyframes, and ends it when it has fallen."""

    def __init__(self, node: InProcessNode) -> None:
        super().__init__(node)
        self._collector = MetricsCollector()
        self._simulator: dict[int, bytes] = {}  # keyframes by stamp, ns
        self._controller: dict[int, bytes] = {}
        for topic in topics.TABLE:
            for each in topic.as_others_name_it if topic.is_measured else ():
                node.listen(each, partial(self._measure, each.name))
        node.listen(_KEYFRAME, partial(_keep, self._simulator))
        node.listen(_CONTROLLER_KEYFRAME, partial(_keep, self._controller))

    def _measure(self, topic: str, raw: bytes) -> None:
        self._collector.take(topic, raw, None)

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Wait until it has fallen, or `stop`."""
        del executor
        next_look = 0
        while not stop:
            tick = self._collector.last_tick
            if tick >= next_look:
                next_look = tick + _LOOK_TICKS
                if tick and self._collector.has_fallen():
                    return
            yield UNTIL_A_MESSAGE

    def outcome(self, recording: Recording, begin: int) -> Outcome:
        """What the run, which has ended, has shown; it began with a row's state.

        Raises:
            RunError: it was not measured to its end.
        """
        if self._collector.missing_ticks:
            raise RunError("a tick was not measured")
        is_down = self._collector.results()[1]["is_down"]
        clock, first = clock_of(recording), first_tick_of(recording)
        rows = {clock.tick(stamp_ns) - first: stamp_ns for stamp_ns in self._simulator}
        keyframes = [
            Keyframe(row, self._simulator[stamp_ns], self._controller[stamp_ns])
            for row, stamp_ns in rows.items()
            if stamp_ns in self._controller
            and begin < row <= begin + len(is_down)
            and is_down[row - begin - 1] != 1.0
        ]
        return Outcome(self._collector.has_fallen(), keyframes)


def _keep(keyframes: dict[int, bytes], raw: bytes) -> None:
    keyframes[decode_keyframe(raw).stamp_ns] = raw
