"""Runs a plan: as processes that speak over topics, or joined in one process without ROS."""

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from actuated_characters.metrics.falls import reader_for
from actuated_characters.metrics.run_metrics import Measurement
from actuated_characters.runs.in_process import Watch, ticks_in_process
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned_files import Planned, write_planned
from actuated_characters.runs.planned_throws import PlannedThrow
from actuated_characters.runs.planned_velocities import PlannedVelocity
from actuated_characters.runs.planned_wrenches import PlannedPush
from actuated_characters.runs.processes import Child, Children
from actuated_characters.runs.ros_domain import own_domain
from actuated_characters.runs.run_directory import (
    LOGS,
    PARAMETERS,
    read_metrics,
    write_metrics,
    write_parameters,
)
from controller_node.parameters import make_controller
from msgs_config.errors import RunError
from msgs_config.messages import configuration
from msgs_config.messages.session import SESSION, make_session
from msgs_config.runtime.ros_environment import (
    DISCOVERY_RANGE,
    DOMAIN_ID,
    LOCALHOST,
    is_discovery_off,
)
from sim_node.simulation_factory import make_simulation_settings

_START_TIMEOUT = 120.0  # s until the first answer, on a machine that may be busy with other things
_VIEWER_TIMEOUT = 30.0  # s until its page is there
_POLL_PERIOD = 0.05  # s
_SILENCE = 5.0  # s without a tick, after which the nodes' logs are of interest
_SIGNS = ("waiting for ", "its type must be ")  # in a node's warning about what does not come
_IN_PROCESS_REPORT = 100  # ticks between reports of progress
_TICK = "tick "  # begins the recorder's lines about its progress
_NOTHING_GIVEN: Mapping[str, object] = {}
_COUNTS_IN_PROCESS: Mapping[
    str, object
] = {  # in one process, where no message can be lost or rejected
    **dict.fromkeys(("rejected_commands", "duplicate_commands"), 0),
    **dict.fromkeys(("rejected_pushes", "rejected_throws"), 0),
    **dict.fromkeys(("missing_ticks", "dropped_references"), 0),
    "lost_messages": {},
    "foreign_messages": {},
}

Progress = Callable[[int], None]
"""Is called with the number of ticks so far."""


def run_over_topics(
    plan: RunPlan,
    directory: Path,
    *,
    write_bag: bool,
    progress: Progress = lambda ticks: None,
    recording: Mapping[str, object] = _NOTHING_GIVEN,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
    velocities: Sequence[PlannedVelocity] = (),
    composed: bool = False,
    fork: Mapping[str, object] | None = None,
    resets: int = 0,
    viewer: Mapping[str, object] | None = None,
) -> None:
    """Run recorder, controller and simulator as processes; leaves the figures in a directory.

    With `composed`, controller and simulator are one process. `recording` has parameters of the
    recorder. Pushes, throws and velocities are sent by one more process; in lockstep all are there
    before the first tick. With parameters of the node `fork` that process repeats a recording, with
    so many resets. With those of a `viewer` one more shows the characters in a browser.

    Raises:
        RunError: one of the processes failed, or the simulator rejected a push or throw.
    """
    recording = {**recording, "directory": str(directory), "write_bag": write_bag}
    # messages of other nodes in the domain are of another session, and each process rejects them
    session = ("-p", f"{SESSION.name}:={make_session('/sim_node')}")
    planned = {"pushes": pushes, "throws": throws, "velocities": velocities}
    senders = _plan_senders(directory, planned, recording, fork)
    with run_environment(directory) as environment, Children(directory, environment) as children:
        if viewer is not None:
            progress = watch(children.start_node("viewer", viewer), progress)
        recorder = children.start_node("recorder", {**recording, "progress_period": 0.1}, *session)
        sender = [children.start_node(name, given, *session) for name, given in senders.items()]
        # of the torques, before the first answer, or a tick would go unrecorded
        listeners = (2 + (fork is not None), 2 + len(sender))
        loop = _start_loop(children, plan, session, listeners, composed=composed)
        wait_for_end(loop[0], [*loop[1:], *sender, recorder], progress)
    counts = {"pushes": len(pushes), "throws": len(throws)} if fork is None else {}
    _check_recorded(recorder, directory, plan.ticks - resets, counts)


def _check_recorded(
    recorder: Child, directory: Path, ticks: int, counts: Mapping[str, int]
) -> None:
    """Raise RunError unless the recorder has all ticks, and all inputs were accepted.

    `counts` are the numbers of inputs, where they are known. A reset is a tick without figures.
    """
    if recorder.exit_code:
        raise RunError(f"recorder failed: {recorder.last_words()}")
    recorded, _ = read_metrics(directory)
    if recorded["ticks"] != ticks:
        raise RunError(f"{recorded['ticks']} of {ticks} ticks were recorded")
    for what in ("pushes", "throws"):
        if counts.get(what, 1) and (rejected := recorded[f"rejected_{what}"]):
            of = f"of {counts[what]} " if what in counts else ""
            raise RunError(f"sim_node rejected {rejected} {of}{what}")


def watch(viewer: Child, progress: Progress) -> Progress:
    """Wait for the viewer's page, so that all can be seen; returns a report of progress.

    That reports also, once, that the viewer has ended: the run goes on without it.
    """
    deadline = time.monotonic() + _VIEWER_TIMEOUT
    lines: list[str] = []
    while not lines and viewer.exit_code is None and time.monotonic() < deadline:
        time.sleep(_POLL_PERIOD)
        lines = viewer.read_lines()
    for line in lines:
        print(f"watch it at {line}", flush=True)
    has_ended = False

    def report(ticks: int) -> None:
        nonlocal has_ended
        if viewer.exit_code is not None and not has_ended:
            has_ended = True
            print(f"the run goes on unseen; viewer failed: {viewer.last_words()}", flush=True)
        progress(ticks)

    return report


def _start_loop(
    children: Children,
    plan: RunPlan,
    session: Sequence[str],
    listeners: tuple[int, int],
    *,
    composed: bool,
) -> list[Child]:
    """Start simulator and controller; the process of the simulator, and the other if there is one.

    They begin when so many subscribe to the states and to the torques.
    """
    arguments = [*session]
    for node, count in zip(("sim_node", "controller_node"), listeners, strict=True):
        arguments += ["-p", f"{node}:wait_for_subscribers:={count}"]
    if composed:
        both = {"sim_node": plan.simulator, "controller_node": plan.controller}
        return [children.start_composed("composed", both, *arguments)]
    controller = children.start_node("controller_node", plan.controller, *arguments)
    return [children.start_node("sim_node", plan.simulator, *arguments), controller]


def _plan_senders(
    directory: Path,
    inputs: Mapping[str, Sequence[Planned]],
    recording: Mapping[str, object],
    fork: Mapping[str, object] | None,
) -> dict[str, dict[str, object]]:
    """The parameters of the node that sends what was planned, by its name; none if nothing was."""
    if not any(inputs.values()) and fork is None:
        return {}
    planned = _write_planned(directory, inputs, recording)
    return {"pusher": planned} if fork is None else {"fork": {**planned, **fork}}


def _write_planned(
    directory: Path,
    inputs: Mapping[str, Sequence[Planned]],
    recording: Mapping[str, object],
) -> dict[str, object]:
    """Write what was planned; returns the parameters of the process that sends it.

    It waits for the node that it is for, and for a recorder that keeps the topic in a bag.
    """
    excluded = recording.get("exclude", ())
    assert isinstance(excluded, Collection)
    left_out = {str(name).removeprefix("/") for name in excluded}

    def subscribers(topic: str) -> int:
        return 2 if recording["write_bag"] and topic not in left_out else 1

    files = {what: directory / PARAMETERS / f"{what}.json" for what in inputs}
    for what, planned in inputs.items():
        write_planned(files[what], planned)
    steers = bool(inputs["velocities"])
    return {
        "file": str(files["pushes"]),
        "throws": str(files["throws"]),
        **({"velocities": str(files["velocities"])} if steers else {}),
        "wait_for_subscribers": subscribers("external_wrench"),
        "throw_subscribers": subscribers("throw"),
        **({"velocity_subscribers": subscribers("cmd_vel_stamped")} if steers else {}),
    }


@contextmanager
def run_environment(directory: Path) -> Iterator[dict[str, str]]:
    """An environment that keeps the run's traffic on this machine, and to itself.

    Where discovery is off, which would hide the run's processes from each other, it is LOCALHOST.
    """
    environment = {
        DISCOVERY_RANGE: LOCALHOST,
        "ROS_LOG_DIR": str(directory / LOGS),
        **os.environ,
    }
    if is_discovery_off(environment):
        print(f"{DISCOVERY_RANGE} is OFF; the processes of this run have {LOCALHOST}", flush=True)
        environment[DISCOVERY_RANGE] = LOCALHOST
    if environment.get(DOMAIN_ID):
        yield environment
        return
    with own_domain() as domain:
        print(f"{DOMAIN_ID}={domain}")
        yield {**environment, DOMAIN_ID: str(domain)}


class _Silence:
    """Prints, once each, what the nodes say that they wait for while no tick comes."""

    def __init__(self, children: Sequence[Child]) -> None:
        self._sizes = dict.fromkeys(children, 0)  # of the logs at the last tick
        self._ticks, self._since = 0, time.monotonic()
        self._printed: set[str] = set()

    def look(self, ticks: int) -> None:
        """Look at the nodes' logs if the number of ticks has been the same for a while."""
        now = time.monotonic()
        if ticks != self._ticks:
            self._ticks, self._since = ticks, now
            self._sizes = {child: child.log_size for child in self._sizes}
        if now < self._since + _SILENCE:
            return
        self._since = now  # the logs need not be read all the time
        for child, size in self._sizes.items():
            line = f"{child.name}: {child.last_warning(size)}"
            if line not in self._printed and any(sign in line for sign in _SIGNS):
                self._printed.add(line)
                print(line, flush=True)


def wait_for_end(simulator: Child, others: list[Child], progress: Progress) -> None:
    """Wait until the simulator has ended well, and the others have not ended before."""
    recorder = others[-1]
    start_deadline = time.monotonic() + _START_TIMEOUT
    ticks, silence = 0, _Silence([simulator, *others])
    while simulator.exit_code is None:
        for child in others:
            if child.exit_code is not None:
                raise RunError(f"{child.name} failed: {child.last_words()}")
        for line in recorder.read_lines():
            if line.startswith(_TICK):
                ticks = int(line.removeprefix(_TICK))
        progress(ticks)
        silence.look(ticks)
        if ticks < 2 and time.monotonic() > start_deadline:
            raise RunError(
                f"no answer within {_START_TIMEOUT:g} s; {simulator.name} says: "
                f"{simulator.last_words()}"
            )
        time.sleep(_POLL_PERIOD)
    if simulator.exit_code:
        raise RunError(f"{simulator.name} failed: {simulator.last_words()}")


def run_in_process(
    plan: RunPlan,
    directory: Path,
    *,
    progress: Progress = lambda ticks: None,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
    watch: Watch | None = None,
) -> None:
    """Run the same simulation and controller as one loop without ROS; figures in a directory.

    `watch` is called with the simulation after each tick.

    Raises:
        SimulationError: the simulation diverged.
    """
    write_parameters(directory, "sim_node", plan.simulator)
    write_parameters(directory, "controller_node", plan.controller)
    known = configuration.parse(configuration.describe(plan.character, plan.simulator))
    terrain = make_simulation_settings(plan.simulator).world.terrain
    measurement = Measurement(known, reader_for(plan.character, terrain))
    controller = make_controller(plan.character, plan.reference, plan.controller)
    mode = None
    started = time.perf_counter()
    ticks = ticks_in_process(plan, pushes, throws, controller, watch)
    for count, tick in enumerate(ticks, start=1):
        if controller.mode is not None and controller.mode is not mode:
            mode = controller.mode
            measurement.add_mode(mode.stamp_ns, mode.phase.mode.value)
        measurement.add(tick)
        if count % _IN_PROCESS_REPORT == 0:
            progress(count)
    metrics = measurement.summary(wall_time=time.perf_counter() - started)
    summary = {"character": known.character, **metrics, **_COUNTS_IN_PROCESS}
    write_metrics(directory, summary, measurement.series())
