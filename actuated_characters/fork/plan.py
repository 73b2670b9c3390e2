"""Plans a fork of a recorded run, and checks it before anything starts."""

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from actuated_characters.bags.forked_from import ForkedFrom
from actuated_characters.bags.format.metadata import read_metadata
from actuated_characters.bags.keyframes import KeyframePlace, find_keyframes
from actuated_characters.bags.recording import Recording, find_bag, read_recordings
from actuated_characters.fork.inputs import ForkPoint, recorded_stops
from actuated_characters.metrics.state_hash import hash_of_states
from actuated_characters.recorder.run_directory import read_metrics
from actuated_characters.replay.comparison import clock_of, first_tick_of
from actuated_characters.replay.players.controller_parameters import changed_files, first_parameters
from actuated_characters.replay.world import check_keyframe, simulator_values
from actuated_characters.runs.plan import RunPlan, count_ticks
from actuated_characters.runs.planned.files import Planned
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.throws import PlannedThrow, plan_throws
from actuated_characters.runs.planned.wrenches import PlannedPush, parse_push
from controller_node import parameters as controller_parameters
from controller_node.behaviours.factory import make_motion
from controller_node.references.base import Reference, ReferenceState
from msgs_config.errors import ConfigurationError, RecordingError, one_of
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.parameters import Value, Values
from msgs_config.versions import installed_versions
from sim_node import parameters as simulator_parameters
from sim_node.node_settings import NodeSettings

_AS_A_RUN: Mapping[str, Value] = {  # which ends with an error, rather than pause
    **{"on_fault": "abort", "on_timeout": "abort"},
    **{"initial_state": "given", "wait_for_subscribers": 0},
}
_Input = TypeVar("_Input", PlannedPush, PlannedThrow)
_LOCKSTEP_TIMEOUT = 60.0  # s, where the recorded simulator had none


@dataclass(frozen=True)
class ForkInputs:
    """What is new in a fork, as the command's options give it."""

    settings: Mapping[str, Mapping[str, object]]  # parameters from the fork on, by node
    pushes: Sequence[str] = ()  # LINK:FX,FY,FZ@S
    throws: Sequence[str] = ()
    with_later: bool = True  # repeat what the recording was sent after the fork, too


@dataclass(frozen=True)
class ForkPlan:
    """A fork that was checked."""

    recording: Recording
    plan: RunPlan
    origin: ForkedFrom
    inputs: PlannedInputs  # the new ones
    repeated_throws: Sequence[PlannedThrow]
    resets: int  # that are repeated
    node: Mapping[str, object]  # parameters of the node `fork`
    sensors: Sequence[str]  # topics of those that were recorded
    skipped: int  # ticks of the recording that are not repeated, because a keyframe has their end
    warnings: Sequence[str]


def plan_fork(
    path: Path,
    at: float,
    inputs: ForkInputs,
    duration: float | None = None,
    *,
    from_start: bool = False,
) -> ForkPlan:
    """Plan to repeat a recorded run up to a time, and to go on with new inputs.

    Args:
        path: The run's directory, or its bag.
        at: Time of the state from which on the fork differs, s since the first one.
        inputs: What is new.
        duration: Length in s, from the recording's start; None: that of the recording.
        from_start: Repeat all of the past, rather than from the last keyframe before that time on.

    Raises:
        RecordingError: the recording cannot be repeated exactly; says why.
        ActuatedCharactersError: an input or a time cannot be.
    """
    past = _read_past(path, None if from_start else at)
    recording = past.recording
    point = _fork_point(past, at, duration, with_later=inputs.with_later)
    stops = recorded_stops(recording, point).values()
    plan = _run_plan(past, point.ticks)
    settings = _checked_settings(recording, plan, inputs.settings)
    whole = plan.lasting(past.skipped + point.ticks)
    pushes = [past.at_stamp_of_run(parse_push(text, whole)) for text in inputs.pushes]
    planned, warnings = plan_throws(whole, inputs.throws)
    throws = [past.at_stamp_of_run(throw) for throw in planned]
    for kind, texts, new in (
        ("--push", inputs.pushes, pushes),
        ("--throw", inputs.throws, throws),
    ):
        _check_late_enough(kind, texts, new, past, point.row)
    return ForkPlan(
        recording=recording,
        plan=plan,
        origin=_origin(path, past, point.row),
        inputs=PlannedInputs(pushes, throws),
        repeated_throws=[throw for stop in stops for throw in stop.throws],
        resets=sum(stop.resets for stop in stops),
        node={
            "recording": str(path.absolute()),
            "row": point.row,
            "ticks": point.ticks,
            "later_inputs": point.with_later,
            "settings": json.dumps(settings),
            **({} if past.begin is None else past.begin._asdict()),
        },
        sensors=_recorded_sensors(path, recording),
        skipped=past.skipped,
        warnings=[f"warning: {each}" for each in changed_files(recording)] + list(warnings),
    )


@dataclass(frozen=True)
class _Past:
    """What is repeated of a recording: from its start on, or from a keyframe."""

    recording: Recording  # from there on
    begin: KeyframePlace | None
    skipped: int  # ticks of the recording before

    @property
    def clock(self) -> TickClock:
        """The recorded clock."""
        return clock_of(self.recording)

    def row(self, stamp_ns: int) -> int:
        """The row of a stamp's state."""
        return self.clock.tick(stamp_ns) - first_tick_of(self.recording)

    def time(self, row: int) -> float:
        """The time of a row's state, s since the recording's start."""
        return (self.skipped + row) / self.clock.rate_hz

    def at_stamp_of_run(self, planned: _Input) -> _Input:
        """An input that was planned for a run whose first tick is the first one of all."""
        earlier = first_tick_of(self.recording) - self.skipped - FIRST_TICK
        tick = self.clock.tick(planned.stamp_ns) + earlier
        return replace(planned, stamp_ns=self.clock.stamp_ns(tick))


def _read_past(path: Path, at: float | None) -> _Past:
    """Read a recording; from the last keyframe before a time in s on, if it has one.

    Raises:
        RecordingError: the nodes cannot repeat it exactly.
    """
    keyframes = None if at is None else find_keyframes(find_bag(path))
    begin = None if keyframes is None or at is None else keyframes.before(at)
    recordings = read_recordings(path, begin)
    if begin is not None and recordings[0].versions != installed_versions():
        begin, recordings = None, read_recordings(path)
    recording = _repeatable(path, recordings)
    check_keyframe(recording)
    skipped = 0
    if begin is not None and keyframes is not None:
        clock = clock_of(recording)
        skipped = clock.tick(begin.stamp_ns) - clock.tick(keyframes.first_ns)
    return _Past(recording, begin, skipped)


def _repeatable(path: Path, recordings: Sequence[Recording]) -> Recording:
    """The recording of a bag. Raises RecordingError where the nodes cannot repeat it exactly."""
    recording, *others = recordings
    reason, first = "", first_tick_of(recording)
    if others or recording.world.characters:
        count = max(len(others) + 1, len(recording.world.characters))
        reason = f"it has {count} characters, and a fork repeats a run of one"
    elif recording.parameters.get("mode") == "realtime":
        reason = "it ran in real time, where states depend on when commands came"
    elif not recording.controller:
        reason = (
            f"it has nothing on '{topics.CONTROLLER_NODE}/configuration', so that its controller "
            "cannot be started; one that is not controller_node cannot be repeated"
        )
    elif recording.controller_keyframe is None and (
        first != FIRST_TICK or recording.skipped_states or recording.begins_amid
    ):
        reason = f"it begins with tick {first}, and what the controller did before is not in it"
    elif len(recording.effort) == 0:
        reason = "it has one state only"
    if reason:
        raise RecordingError(f"{path} cannot be forked: {reason}")
    return recording


def _fork_point(past: _Past, at: float, duration: float | None, *, with_later: bool) -> ForkPoint:
    """The state at a time in s, in a fork of a duration in s."""
    rate, last = past.clock.rate_hz, past.skipped + len(past.recording.effort)
    tick = round(at * rate) if math.isfinite(at) else -1
    if not 0 <= tick <= last:
        raise ConfigurationError(f"--at is {at:g} s; it must be 0 s to {last / rate:g} s")
    ticks = last if duration is None else count_ticks(duration, rate)
    if ticks <= tick:
        remedy = "set --duration" if duration is None else "let it be longer"
        raise ConfigurationError(
            f"the fork lasts {ticks / rate:g} s, so that nothing comes after {at:g} s; {remedy}"
        )
    return ForkPoint(tick - past.skipped, ticks - past.skipped, with_later)


def _origin(path: Path, past: _Past, row: int) -> ForkedFrom:
    """Where a fork comes from that begins to differ in a row's state."""
    recording, known = past.recording, ""
    if past.begin is None:
        known = hash_of_states(recording.stamps_ns, recording.position, recording.velocity)
    else:
        with suppress(RecordingError):  # a bag alone does not say it, but for all of its states
            known = str(read_metrics(path)[0].get("state_hash", ""))
    tick = first_tick_of(recording) + row
    return ForkedFrom(str(path.absolute()), known, tick, past.time(row))


def _recorded_sensors(path: Path, recording: Recording) -> list[str]:
    bag = find_bag(path)
    recorded = read_metadata(bag).topics if bag.is_dir() else ()
    names = {name.lstrip("/") for name in recorded}
    return [each.topic for each in recording.character.sensors if each.topic in names]


def _run_plan(past: _Past, ticks: int) -> RunPlan:
    """The recorded run, as one to be started."""
    recording = past.recording
    character, simulator = recording.character, simulator_values(recording)
    timeout = NodeSettings.of(simulator).lockstep_timeout or _LOCKSTEP_TIMEOUT
    simulator = Values({**simulator, **_AS_A_RUN, "lockstep_timeout": timeout, "max_ticks": ticks})
    given = {**first_parameters(recording), "wait_for_subscribers": 0}
    controller = controller_parameters.resolve_for(character, given)
    make_motion(character, controller)  # raises where a file is not there any more
    return RunPlan(character, _RecordedMotion(past), simulator, controller, ())


@dataclass(frozen=True)
class _RecordedMotion(Reference):
    """The motion that was recorded, at which balls are thrown; after its end, its last state."""

    past: _Past

    def sample(self, time: float) -> ReferenceState:
        """The state at a time in s since the start; before what is repeated, the first of it."""
        recording, row = self.past.recording, round(time * self.past.clock.rate_hz)
        row = min(max(row - self.past.skipped, 0), len(recording.position) - 1)
        configuration = recording.layout.configuration(recording.position[row])
        velocity = recording.velocity[row]
        return ReferenceState(configuration, velocity, np.zeros_like(velocity))


def _checked_settings(
    recording: Recording, plan: RunPlan, settings: Mapping[str, Mapping[str, object]]
) -> dict[str, dict[str, Value]]:
    """New parameters in their types.

    Raises:
        ConfigurationError: one is wrong, or cannot change in a run.
    """
    character = recording.character
    own = {
        topics.SIM_NODE: simulator_parameters.PARAMETERS,
        topics.CONTROLLER_NODE: controller_parameters.PARAMETERS
        + controller_parameters.character_parameters(character, plan.controller),
    }
    checked: dict[str, dict[str, Value]] = {}
    for node, given in settings.items():
        declared = {each.name: each for each in own[node]}
        for name, value in given.items():
            if name not in declared:
                raise ConfigurationError(one_of(f"parameter of {node}", name, sorted(declared)))
            checked.setdefault(node, {})[name] = declared[name].checked(value)
            if not declared[name].live:
                why = "cannot change while a run goes on"
                if declared[name].at_reset:
                    why = "changes at a reset alone"
                raise ConfigurationError(
                    f"parameter '{name}' of {node} {why}, so not in a fork; "
                    f"'actuated_characters run --parameters {node}' says which are live"
                )
    return checked


def _check_late_enough(
    kind: str, texts: Sequence[str], planned: Sequence[Planned], past: _Past, row: int
) -> None:
    """Raise ConfigurationError if something new begins before the state of a row."""
    for text, each in zip(texts, planned, strict=True):
        begins = past.row(each.stamp_ns)
        if begins < row:
            raise ConfigurationError(
                f"{kind} '{text}' begins at {past.time(begins):.4g} s, before the fork at "
                f"{past.time(row):.4g} s; let it begin later"
            )
