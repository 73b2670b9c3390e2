"""Runs a plan: as processes that speak over topics, or joined in one process without ROS."""

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from actuated_characters.metrics.run_metrics import Measurement
from actuated_characters.runs.in_process import ticks_in_process
from actuated_characters.runs.plan import Plan
from actuated_characters.runs.planned_throws import PlannedThrow, write_throws
from actuated_characters.runs.planned_wrenches import PlannedPush, write_pushes
from actuated_characters.runs.processes import Child, Children
from actuated_characters.runs.ros_domain import own_domain
from actuated_characters.runs.run_directory import (
    LOGS,
    PARAMETERS,
    read_figures,
    write_figures,
    write_parameters,
)
from msgs_config.errors import RunError
from msgs_config.messages import configuration
from msgs_config.messages.session import SESSION, make_session

_START_PATIENCE = 120.0  # s until the first answer, on a machine that may be busy with other things
_POLL_PERIOD = 0.05  # s
_IN_PROCESS_REPORT = 100  # ticks between reports of progress
_NOTHING_GIVEN: Mapping[str, object] = {}

Progress = Callable[[int], None]
"""Is told the number of ticks so far."""


def run_over_topics(
    plan: Plan,
    directory: Path,
    *,
    write_bag: bool,
    progress: Progress,
    recording: Mapping[str, object] = _NOTHING_GIVEN,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
) -> None:
    """Run recorder, controller and simulator as processes; leaves the figures in a directory.

    `recording` has parameters of the recorder: how the bag is stored, topics more or fewer. Pushes
    and throws are sent by one more process; in lockstep all are there before the first tick.

    Raises:
        RunError: one of the processes failed, with its own message, or what was planned came too
            late.
    """
    # what other nodes in the domain say is of another session, and each process rejects it
    session = ("-p", f"{SESSION.name}:={make_session('/sim_node')}")
    with _environment(directory) as environment, Children() as children:

        def start(name: str, module: str, parameters: Mapping[str, object], *more: str) -> Child:
            file = write_parameters(directory, name, parameters)
            log = directory / LOGS / f"{name}.log"
            arguments = ["--ros-args", "--params-file", str(file), *session, *more]
            return children.start(lambda: Child(name, module, arguments, log, environment))

        listening = {
            **recording,
            "directory": str(directory),
            "write_bag": write_bag,
            "progress_period": 0.1,
        }
        recorder = start("recorder", "actuated_characters.recorder.main", listening)
        # both must be there before the first answer, or a tick would go unrecorded
        both = ("-p", "wait_for_subscribers:=2")
        all_three = ("-p", f"wait_for_subscribers:={3 if pushes or throws else 2}")
        others = [recorder]
        if pushes or throws:
            sending = _planned_files(directory, pushes, throws)
            excluded = recording.get("exclude", ())
            assert isinstance(excluded, Collection)
            sending |= _planned_listeners(write_bag, excluded)
            others.insert(0, start("pusher", "actuated_characters.runs.perturbation_main", sending))
        others.insert(
            0, start("controller_node", "controller_node.main", plan.controller, *all_three)
        )
        simulator = start("sim_node", "sim_node.main", plan.simulator, *both)
        _wait_for_end(simulator, others, progress)
    if recorder.exit_code:
        raise RunError(f"recorder failed: {recorder.last_words()}")
    recorded, _ = read_figures(directory)
    if recorded["ticks"] != plan.ticks:
        raise RunError(f"{recorded['ticks']} of {plan.ticks} ticks were recorded")
    for what, planned in (("pushes", pushes), ("throws", throws)):
        refused = recorded[f"rejected_{what}"]
        if planned and refused:
            raise RunError(f"sim_node refused {refused} of {len(planned)} {what}")


def _planned_files(
    directory: Path, pushes: Sequence[PlannedPush], throws: Sequence[PlannedThrow]
) -> dict[str, object]:
    """Write what was planned; the sender's parameters that say where it is."""
    folder = directory / PARAMETERS
    write_pushes(folder / "pushes.json", pushes)
    write_throws(folder / "throws.json", throws)
    return {"file": str(folder / "pushes.json"), "throws": str(folder / "throws.json")}


def _planned_listeners(write_bag: bool, excluded: Collection[str]) -> dict[str, object]:
    """How many listen to what is sent: the simulator, and a recorder that keeps it in a bag."""
    left_out = {str(name).removeprefix("/") for name in excluded} if write_bag else None
    return {
        parameter: 1 + int(left_out is not None and topic not in left_out)
        for parameter, topic in (
            ("wait_for_subscribers", "external_wrench"),
            ("throw_subscribers", "throw"),
        )
    }


@contextmanager
def _environment(directory: Path) -> Iterator[dict[str, str]]:
    """An environment that keeps the run's traffic on this machine, and to itself."""
    environment = {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(directory / LOGS),
        **os.environ,
    }
    if environment.get("ROS_DOMAIN_ID"):
        yield environment
        return
    with own_domain() as domain:
        print(f"ROS_DOMAIN_ID={domain}")
        yield {**environment, "ROS_DOMAIN_ID": str(domain)}


def _wait_for_end(simulator: Child, others: list[Child], progress: Progress) -> None:
    """Wait until the simulator has ended well, and the others have not ended before."""
    recorder = others[-1]
    start_deadline = time.monotonic() + _START_PATIENCE
    ticks = 0
    while simulator.exit_code is None:
        for child in others:
            if child.exit_code is not None:
                raise RunError(f"{child.name} failed: {child.last_words()}")
        ticks = _last_tick(recorder.read_output()) or ticks
        progress(ticks)
        if ticks < 2 and time.monotonic() > start_deadline:
            raise RunError(
                f"no answer within {_START_PATIENCE:g} s; sim_node says: {simulator.last_words()}"
            )
        time.sleep(_POLL_PERIOD)
    if simulator.exit_code:
        raise RunError(f"sim_node failed: {simulator.last_words()}")


def _last_tick(output: str) -> int | None:
    """The last tick in what the recorder has printed, in lines of `tick N`."""
    numbers = [line.removeprefix("tick ") for line in output.splitlines()]
    whole = [int(number) for number in numbers if number.isdecimal()]
    return whole[-1] if whole else None


def run_in_process(
    plan: Plan,
    directory: Path,
    *,
    progress: Progress,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
) -> None:
    """Run the same simulation and controller as one loop without ROS; figures in a directory.

    Raises:
        SimulationError: the simulation diverged.
    """
    write_parameters(directory, "sim_node", plan.simulator)
    write_parameters(directory, "controller_node", plan.controller)
    known = configuration.parse(configuration.describe(plan.character, plan.simulator))
    measurement = Measurement(known)
    started = time.perf_counter()
    for count, tick in enumerate(ticks_in_process(plan, pushes, throws), start=1):
        measurement.add(tick)
        if count % _IN_PROCESS_REPORT == 0:
            progress(count)
    figures = measurement.summary(wall_time=time.perf_counter() - started)
    counts = {"rejected_commands": 0, "duplicate_commands": 0}
    counts |= {"rejected_pushes": 0, "rejected_throws": 0}
    losses: dict[str, object] = {"missing_ticks": 0, "dropped_references": 0}
    losses |= {"lost_messages": {}, "foreign_messages": {}}
    summary = {"character": known.character} | figures | counts | losses
    write_figures(directory, summary, measurement.series())
