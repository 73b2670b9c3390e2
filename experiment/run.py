"""Runs a plan: as processes that speak over topics, or joined in one process without ROS."""

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import yaml

from controller_node.parameters import make_controller
from experiment.domain import own_domain
from experiment.figures import LOGS, PARAMETERS, write_figures
from experiment.metrics import Measurement, Tick
from experiment.plan import Plan
from experiment.processes import Child, Children
from msgs_config import configuration
from msgs_config.errors import RunError
from sim_node.parameters import make_settings
from sim_node.simulation import Simulation

_START_PATIENCE = 120.0  # s until the first tick, on a machine that may be busy with other things
_POLL_PERIOD = 0.05  # s
_IN_PROCESS_REPORT = 100  # ticks between reports of progress

Progress = Callable[[int], None]
"""Is told the number of ticks so far."""


def run_over_topics(plan: Plan, directory: Path, *, write_bag: bool, progress: Progress) -> None:
    """Run recorder, controller and simulator as three processes; leaves the figures in a directory.

    Raises:
        RunError: one of the processes failed; with its own message.
    """
    with _environment() as environment, Children() as children:

        def start(name: str, module: str, parameters: Mapping[str, object]) -> Child:
            file = directory / PARAMETERS / f"{name}.yaml"
            file.write_text(yaml.safe_dump({name: {"ros__parameters": dict(parameters)}}))
            arguments = ["--ros-args", "--params-file", str(file)]
            log = directory / LOGS / f"{name}.log"
            return children.start(Child(name, module, arguments, log, environment))

        listening = {"directory": str(directory), "write_bag": write_bag}
        recorder = start(
            "recorder", "experiment.recorder_main", {**listening, "progress_period": 0.1}
        )
        # simulator and recorder must be there before the first answer, lest a tick go unrecorded
        controls = {**plan.controller, "wait_for_subscribers": 2}
        controller = start("controller_node", "controller_node.main", controls)
        simulates = {**plan.simulator, "wait_for_subscribers": 2}
        simulator = start("sim_node", "sim_node.main", simulates)
        _wait_for_end(simulator, [controller, recorder], progress)
    if recorder.exit_code:
        raise RunError(f"recorder failed: {recorder.last_words()}")


@contextmanager
def _environment() -> Iterator[dict[str, str]]:
    """An environment that keeps the run's traffic on this machine, and to itself."""
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **os.environ}
    if "ROS_DOMAIN_ID" in environment:
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
        if ticks < 1 and time.monotonic() > start_deadline:
            raise RunError(
                f"no tick within {_START_PATIENCE:g} s; sim_node says: {simulator.last_words()}"
            )
        time.sleep(_POLL_PERIOD)
    if simulator.exit_code:
        raise RunError(f"sim_node failed: {simulator.last_words()}")


def _last_tick(output: str) -> int | None:
    """The last tick in what the recorder has printed, in lines of `tick N`."""
    numbers = [line.removeprefix("tick ") for line in output.splitlines()]
    whole = [int(number) for number in numbers if number.isdecimal()]
    return whole[-1] if whole else None


def run_in_process(plan: Plan, directory: Path, *, progress: Progress) -> None:
    """Run the same simulation and controller as one loop without ROS; figures in a directory.

    Raises:
        SimulationError: the simulation diverged.
    """
    known = configuration.parse(configuration.describe(plan.character, plan.simulator))
    measurement = Measurement(known)
    controller = make_controller(plan.character, plan.reference, plan.controller)
    with Simulation(plan.character, make_settings(plan.simulator)) as simulation:
        episode_ns = simulation.state.stamp_ns
        measurement.add_state(simulation.state)
        started = time.perf_counter()
        for tick in range(1, plan.ticks + 1):
            state = simulation.state
            effort, reference = controller.answer(state, episode_ns)
            following = simulation.step(np.where(simulation.commanded, effort, 0.0))
            assert following.effort is not None
            measurement.add_state(following)
            measurement.add_tick(Tick(state, following.effort, reference))
            if tick % _IN_PROCESS_REPORT == 0:
                progress(tick)
        wall_time = time.perf_counter() - started
    summary = {"character": known.character} | measurement.summary(wall_time)
    counts = {"rejected_commands": 0, "duplicate_commands": 0}
    write_figures(directory, summary | counts, measurement.series())
