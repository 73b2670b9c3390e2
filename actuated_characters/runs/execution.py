"""Runs a plan as processes that speak over topics."""

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from actuated_characters.recorder.run_directory import LOGS, write_parameters
from actuated_characters.runs.foreign_controller import ForeignController
from actuated_characters.runs.in_process import Progress
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.inputs import NO_INPUTS, PlannedInputs
from actuated_characters.runs.processes import FOREIGN, Child, Children, Member
from actuated_characters.runs.ros_domain import own_domain
from actuated_characters.runs.senders import check_recorded, plan_senders
from msgs_config.errors import RunError
from msgs_config.messages.session import SESSION, make_session
from msgs_config.runtime.ros_environment import (
    DISCOVERY_RANGE,
    DOMAIN_ID,
    LOCALHOST,
    is_discovery_off,
)

START_TIMEOUT = 120.0
"""s until the first answer, on a machine that may be busy with other things."""
_VIEWER_TIMEOUT = 30.0  # s until its page is there
_POLL_PERIOD = 0.05  # s
_SILENCE = 5.0  # s without a tick, after which the nodes' logs are of interest
_SIGNS = ("waiting for ", "its type must be ")  # begin a node's warning about what does not come
_CONTROLLERS = (FOREIGN, "controller_node")
_REJECTED = "rejected"  # is what a simulator says of a command that it does not take
_TICK = "tick "  # begins the recorder's lines about its progress
_NOTHING_GIVEN: Mapping[str, object] = {}


class ControllerError(RunError):
    """A controller ended, gave no answer, or one with which the simulator could not go on."""


def run_over_topics(
    plan: RunPlan,
    directory: Path,
    *,
    write_bag: bool,
    progress: Progress = lambda ticks: None,
    recording: Mapping[str, object] = _NOTHING_GIVEN,
    inputs: PlannedInputs = NO_INPUTS,
    composed: bool = False,
    fork: Mapping[str, object] | None = None,
    resets: int = 0,
    viewer: Mapping[str, object] | None = None,
    foreign: ForeignController | None = None,
    start_timeout: float = START_TIMEOUT,
) -> None:
    """Run recorder, controller and simulator as processes; leaves the figures in a directory.

    Without a bag the recorder is a thread of this process. With `composed`, controller and
    simulator are one process. `recording` has parameters of the recorder. `inputs` are sent by
    one more process; in lockstep all are there before the first tick. With
    parameters of the node `fork` that process repeats a recording, with so many resets. With those
    of a `viewer` one more shows the characters in a browser. A `foreign` controller takes the
    place of `controller_node`. The first answer has to come within `start_timeout` s.

    Raises:
        ControllerError: the controller is to blame.
        RunError: one of the processes failed, or the simulator rejected a push or throw.
    """
    about = {"directory": str(directory), "write_bag": write_bag, "progress_period": 0.1}
    recording = {**recording, **about}
    # messages of other nodes in the domain are of another session, and each process rejects them
    session = ("-p", f"{SESSION.name}:={make_session('/sim_node')}")
    senders = plan_senders(directory, inputs, recording, fork, simulator_waits=foreign is not None)
    with run_environment(directory) as environment, Children(directory, environment) as children:
        if viewer is not None:
            progress = watch(children.start_node("viewer", viewer), progress)
        recorder: Member | None = None
        if write_bag:
            recorder = children.start_node("recorder", recording, *session)
        sender = [children.start_node(name, given, *session) for name, given in senders.items()]
        if foreign is not None:
            loop = _start_foreign(children, plan, session, foreign, 1 + len(sender))
        else:
            # of the torques, before the first answer, or a tick would go unrecorded
            listeners = (2 + (fork is not None), 2 + len(sender))
            loop = _start_loop(children, plan, session, listeners, composed=composed)
        if recorder is None:
            recorder = _start_measuring(children, recording, session, environment)
        wait_for_end(loop[0], [*loop[1:], *sender, recorder], progress, start_timeout)
    if recorder.exit_code:
        raise RunError(f"recorder failed: {recorder.last_words()}")
    check_recorded(directory, plan.ticks - resets, inputs if fork is None else None)


def _start_measuring(
    children: Children,
    recording: Mapping[str, object],
    session: Sequence[str],
    environment: Mapping[str, str],
) -> Member:
    """Start a recorder that writes no bag, in a thread of this process."""
    from actuated_characters.runs.recorder_thread import RecorderThread

    file = write_parameters(children.directory, "recorder", recording)
    return children.start_thread(lambda: RecorderThread(file, environment, session))


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


def _start_foreign(
    children: Children,
    plan: RunPlan,
    session: Sequence[str],
    foreign: ForeignController,
    others: int,
) -> list[Child]:
    """Start simulator and anybody's controller, which need not know whom it should wait for.

    The simulator begins when it and so many others subscribe to the states.
    """
    controller = children.start_foreign(foreign, session[1].partition(":=")[2], plan.controller)
    awaited = f"sim_node:wait_for_subscribers:={foreign.subscriptions + others}"
    return [children.start_node("sim_node", plan.simulator, *session, "-p", awaited), controller]


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

    def __init__(self, children: Sequence[Member]) -> None:
        self._sizes = dict.fromkeys(children, 0)  # sizes of the logs at the last tick
        self._ticks, self._since = 0, time.monotonic()
        self._printed: set[str] = set()

    def watch_ticks(self, ticks: int) -> None:
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


def wait_for_end(
    simulator: Member,
    others: Sequence[Member],
    progress: Progress,
    start_timeout: float = START_TIMEOUT,
) -> None:
    """Wait until the simulator has ended well, and the others have not ended before."""
    recorder = others[-1]
    start_deadline = time.monotonic() + start_timeout
    ticks, silence = 0, _Silence([simulator, *others])
    while simulator.exit_code is None:
        for child in others:
            if child.exit_code is not None:
                kind = ControllerError if child.name in _CONTROLLERS else RunError
                raise kind(f"{child.name} failed: {child.last_words()}")
        for line in recorder.read_lines():
            if line.startswith(_TICK):
                ticks = int(line.removeprefix(_TICK))
        progress(ticks)
        silence.watch_ticks(ticks)
        if ticks < 2 and time.monotonic() > start_deadline:
            raise ControllerError(
                f"no answer within {start_timeout:g} s; {simulator.name} says: "
                f"{_last_said(simulator)}"
            )
        time.sleep(_POLL_PERIOD)
    if simulator.exit_code:
        kind = ControllerError if simulator.exit_code > 0 else RunError  # else it was killed
        raise kind(f"{simulator.name} failed: {_reason(simulator)}")


def _last_said(simulator: Member) -> str:
    """What it says of a command, or what it waits for."""
    found = (simulator.last_warning(0, saying) for saying in (_REJECTED, ""))
    return next(filter(None, found), simulator.last_words())


def _reason(simulator: Member) -> str:
    """Why a simulator ended, and what it had said of the commands before."""
    words, warning = simulator.last_words(), simulator.last_warning(0, _REJECTED)
    return f"{words} (before: {warning})" if warning else words
