"""Runs in this process, without ROS: of the nodes on a bus of their own, or of the bare loop."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import numpy as np

from actuated_characters.metrics.run_metrics import Tick
from actuated_characters.recorder.in_process import InProcessRecorder
from actuated_characters.recorder.run_directory import LOGS, write_parameters
from actuated_characters.runs.held_signals import signals_held
from actuated_characters.runs.perturbation_node import PerturbationNode
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned_throws import PlannedThrow
from actuated_characters.runs.planned_velocities import PlannedVelocity
from actuated_characters.runs.planned_wrenches import PlannedPush, push_schedule
from actuated_characters.runs.senders import check_recorded, plan_senders
from controller_node.controller import Controller
from controller_node.node import ControllerNode
from controller_node.parameters import make_controller
from msgs_config.bus.composition import ComposableNode, run_nodes
from msgs_config.bus.in_process import Bus, InProcessNode
from msgs_config.bus.node import BusNode
from msgs_config.errors import RecordingError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.session import SESSION, make_session
from sim_node.node import SimNode
from sim_node.physics.simulation import Simulation
from sim_node.physics.throws import ThrowQueue
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

_PROGRESS_PERIOD = 0.1  # s between words on the progress
_NOTHING_GIVEN: Mapping[str, object] = {}

Progress = Callable[[int], None]
"""Is called with the number of ticks so far."""
Watch = Callable[[Simulation], object]
"""Is called with the simulation after each tick."""


def ticks_in_process(
    plan: RunPlan,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
    controller: Controller | None = None,
    watch: Watch | None = None,
) -> Iterator[Tick]:
    """The ticks of a plan, one by one, with pushes and throws.

    The states are those of a run over topics, bit for bit. To look at the controller as well, give
    a fresh one of the plan; to look at the simulation, a `watch`.

    Raises:
        SimulationError: the simulation diverged.
    """
    controller = controller or make_controller(plan.character, plan.reference, plan.controller)
    setup = make_character_setup(plan.character, plan.simulator)
    wrenches, clock = push_schedule(plan, pushes), TickClock(plan.simulator.integer("rate"))
    balls = ThrowQueue()
    for throw in throws:
        balls.add(throw.throw, clock.first_tick_from(throw.stamp_ns))
    with Simulation([setup], make_simulation_settings(plan.simulator)) as simulation:
        simulation.watches_contacts = controller.needs_contacts
        (character,) = simulation.characters
        episode_ns = character.state.stamp_ns
        drives_all = character.commanded.all()
        for _ in range(plan.ticks):
            state = character.state
            touched = None if character.contacts is None else character.contacts.wrenches
            effort, reference = controller.compute_effort(state, episode_ns, touched)
            commanded = effort if drives_all else np.where(character.commanded, effort, 0.0)
            acting, thrown = wrenches.take(simulation.tick), balls.take(simulation.tick)
            simulation.step([commanded], [acting], thrown)
            following = character.state
            assert following.effort is not None
            if watch is not None:
                watch(simulation)
            yield Tick(state, following, reference)


def run_in_process(
    plan: RunPlan,
    directory: Path,
    *,
    write_bag: bool = True,
    progress: Progress = lambda ticks: None,
    recording: Mapping[str, object] = _NOTHING_GIVEN,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
    velocities: Sequence[PlannedVelocity] = (),
    fork: Mapping[str, object] | None = None,
    resets: int = 0,
    make_sender: Callable[[BusNode], ComposableNode] = PerturbationNode,
) -> None:
    """Run the nodes of a run over topics on a bus of this process; all else is as there.

    They send the same messages in the same order, so the bag differs in wall times alone.
    `make_sender` makes the node that sends what was planned.

    Raises:
        ActuatedCharactersError: one of the nodes failed, or the simulator rejected an input.
    """
    session = {SESSION.name: make_session("/sim_node")}
    recording = {**recording, "directory": str(directory), "write_bag": write_bag}
    planned = {"pushes": pushes, "throws": throws, "velocities": velocities}
    senders = plan_senders(directory, planned, recording, fork)
    given: dict[str, dict[str, object]] = {
        "recorder": {**recording, "progress_period": _PROGRESS_PERIOD},
        **senders,
        "controller_node": {**plan.controller, "wait_for_subscribers": 2 + len(senders)},
        "sim_node": {**plan.simulator, "wait_for_subscribers": 2 + (fork is not None)},
    }
    for name, parameters in given.items():
        write_parameters(directory, name, parameters)
    bus = Bus(partial(_log, directory / LOGS))
    places = {name: bus.node(name, {**parameters, **session}) for name, parameters in given.items()}
    with signals_held(most=1) as stop, _recorder(places["recorder"], progress) as recorder:
        nodes: list[ComposableNode] = [recorder]
        nodes += [make_sender(places[name]) for name in senders]
        nodes += [ControllerNode(places["controller_node"]), SimNode(places["sim_node"])]
        run_nodes(nodes, stop)
    counts = {"pushes": len(pushes), "throws": len(throws)} if fork is None else {}
    check_recorded(directory, plan.ticks - resets, counts)


@contextmanager
def _recorder(
    node: InProcessNode, progress: Callable[[int], object]
) -> Iterator[InProcessRecorder]:
    """A recorder whose bag and figures are there in the end, also after an error of the others."""
    recorder = InProcessRecorder(node, progress)
    try:
        yield recorder
    except BaseException:
        recorder.close()
        with suppress(RecordingError):  # that little was recorded is not what went wrong
            recorder.conclude()
        raise
    recorder.close()
    recorder.conclude()


def _log(folder: Path, name: str, severity: str, sentence: str) -> None:
    """Write what a node logs into its file, as rcutils does."""
    line = f"[{severity.upper().removesuffix('ING')}] [{time.time():.9f}] [{name}]: {sentence}\n"
    with (folder / f"{name.replace('/', '.')}.log").open("a", encoding="utf-8") as file:
        file.write(line)
