"""Plans a fork of a recorded run, and checks it before anything starts."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.bags.format.metadata import read_metadata
from actuated_characters.bags.recording import Recording, find_bag, read_recordings
from actuated_characters.fork.inputs import ForkPoint, recorded_stops
from actuated_characters.metrics.state_hash import hash_of_states
from actuated_characters.recorder.forked_from import ForkedFrom
from actuated_characters.replay.comparison import clock_of
from actuated_characters.replay.players.controller_parameters import first_parameters
from actuated_characters.replay.world import simulator_values
from actuated_characters.runs.plan import RunPlan, count_ticks
from actuated_characters.runs.planned.files import Planned
from actuated_characters.runs.planned.throws import PlannedThrow, plan_throws
from actuated_characters.runs.planned.wrenches import PlannedPush, parse_push
from controller_node import parameters as controller_parameters
from controller_node.planner.factory import check_installed
from controller_node.references.base import Reference, ReferenceState
from controller_node.references.factory import make_motion
from msgs_config.errors import ConfigurationError, RecordingError, one_of
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK
from msgs_config.parameters import Value, Values
from sim_node import parameters as simulator_parameters

_AS_A_RUN: Mapping[str, Value] = {  # which ends with an error, rather than pause
    **{"on_fault": "abort", "on_timeout": "abort"},
    **{"initial_state": "given", "wait_for_subscribers": 0},
}
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
    pushes: Sequence[PlannedPush]  # the new ones
    throws: Sequence[PlannedThrow]
    repeated_throws: Sequence[PlannedThrow]
    resets: int  # that are repeated
    node: Mapping[str, object]  # parameters of the node `fork`
    sensors: Sequence[str]  # topics of those that were recorded
    warnings: Sequence[str]


def plan_fork(path: Path, at: float, inputs: ForkInputs, duration: float | None = None) -> ForkPlan:
    """Plan to repeat a recorded run up to a time, and to go on with new inputs.

    Args:
        path: The run's directory, or its bag.
        at: Time of the state from which on the fork differs, s since the first one.
        inputs: What is new.
        duration: Length in s; None: that of the recording.

    Raises:
        RecordingError: the recording cannot be repeated exactly; says why.
        ActuatedCharactersError: an input or a time cannot be.
    """
    recording = _repeatable(path)
    point = _fork_point(recording, at, duration, with_later=inputs.with_later)
    stops, row = recorded_stops(recording, point).values(), point.row
    plan = _run_plan(recording, point.ticks)
    settings = _checked_settings(recording, plan, inputs.settings)
    pushes = [parse_push(text, plan) for text in inputs.pushes]
    throws, warnings = plan_throws(plan, inputs.throws)
    for kind, texts, planned in (
        ("--push", inputs.pushes, pushes),
        ("--throw", inputs.throws, throws),
    ):
        _check_late_enough(kind, texts, planned, recording, row)
    node = {"row": row, "ticks": point.ticks, "later_inputs": point.with_later}
    origin, time = str(path.absolute()), row / clock_of(recording).rate_hz
    recorded = hash_of_states(recording.stamps_ns, recording.position, recording.velocity)
    return ForkPlan(
        recording=recording,
        plan=plan,
        origin=ForkedFrom(origin, recorded, FIRST_TICK + row, time),
        pushes=pushes,
        throws=throws,
        repeated_throws=[throw for stop in stops for throw in stop.throws],
        resets=sum(stop.resets for stop in stops),
        node={**node, "recording": origin, "settings": json.dumps(settings)},
        sensors=_recorded_sensors(path, recording),
        warnings=warnings,
    )


def _fork_point(
    recording: Recording, at: float, duration: float | None, *, with_later: bool
) -> ForkPoint:
    """The state at a time in s, in a fork of a duration in s."""
    rate, last = clock_of(recording).rate_hz, len(recording.effort)
    row = round(at * rate) if math.isfinite(at) else -1
    if not 0 <= row <= last:
        raise ConfigurationError(f"--at is {at:g} s; it must be 0 s to {last / rate:g} s")
    ticks = last if duration is None else count_ticks(duration, rate)
    if ticks <= row:
        remedy = "set --duration" if duration is None else "let it be longer"
        raise ConfigurationError(
            f"the fork lasts {ticks / rate:g} s, so that nothing comes after {at:g} s; {remedy}"
        )
    return ForkPoint(row, ticks, with_later)


def _repeatable(path: Path) -> Recording:
    """Read the recording. Raises RecordingError where the nodes cannot repeat it exactly."""
    recording, *others = read_recordings(path)
    reason, first = "", clock_of(recording).tick(int(recording.stamps_ns[0]))
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
    elif first != FIRST_TICK or recording.skipped_states or recording.begins_amid:
        reason = f"it begins with tick {first}, and what the controller did before is not in it"
    elif len(recording.effort) == 0:
        reason = "it has one state only"
    if reason:
        raise RecordingError(f"{path} cannot be forked: {reason}")
    return recording


def _recorded_sensors(path: Path, recording: Recording) -> list[str]:
    bag = find_bag(path)
    recorded = read_metadata(bag).topics if bag.is_dir() else ()
    names = {name.lstrip("/") for name in recorded}
    return [each.topic for each in recording.character.sensors if each.topic in names]


def _run_plan(recording: Recording, ticks: int) -> RunPlan:
    """The recorded run, as one to be started."""
    character, simulator = recording.character, simulator_values(recording)
    timeout = simulator.number("lockstep_timeout") or _LOCKSTEP_TIMEOUT
    simulator = Values({**simulator, **_AS_A_RUN, "lockstep_timeout": timeout, "max_ticks": ticks})
    given = {**first_parameters(recording), "wait_for_subscribers": 0}
    controller = controller_parameters.resolve_for(character, given)
    check_installed(controller)
    make_motion(character, controller)  # raises where a file is not there any more
    return RunPlan(character, _RecordedMotion(recording), simulator, controller, ())


@dataclass(frozen=True)
class _RecordedMotion(Reference):
    """The motion that was recorded, at which balls are thrown; after its end, its last state."""

    recording: Recording

    def sample(self, time: float) -> ReferenceState:
        """The state at a time in s since the first one."""
        recording = self.recording
        row = min(round(time * clock_of(recording).rate_hz), len(recording.position) - 1)
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
                    f"'actuated_characters parameters {node}' says which are live"
                )
    return checked


def _check_late_enough(
    kind: str, texts: Sequence[str], planned: Sequence[Planned], recording: Recording, row: int
) -> None:
    """Raise ConfigurationError if something new begins before the state of a row."""
    clock = clock_of(recording)
    for text, each in zip(texts, planned, strict=True):
        begins = clock.tick(each.stamp_ns) - FIRST_TICK
        if begins < row:
            raise ConfigurationError(
                f"{kind} '{text}' begins at {begins / clock.rate_hz:.4g} s, before the fork at "
                f"{row / clock.rate_hz:.4g} s; let it begin later"
            )
