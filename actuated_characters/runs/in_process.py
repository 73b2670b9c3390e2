"""Runs in this process, without ROS: the nodes of a run over topics, on a bus of their own."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path

from actuated_characters.recorder.in_process import InProcessRecorder
from actuated_characters.recorder.run_directory import LOGS, write_parameters
from actuated_characters.runs.held_signals import signals_held
from actuated_characters.runs.perturbation_node import PerturbationNode
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.inputs import NO_INPUTS, PlannedInputs
from actuated_characters.runs.senders import check_recorded, plan_senders
from controller_node.node import ControllerNode
from msgs_config.bus.composition import ComposableNode, run_nodes
from msgs_config.bus.in_process import Bus, InProcessNode
from msgs_config.bus.node import BusNode, StopFlag
from msgs_config.errors import ConfigurationError, RecordingError, RunError
from msgs_config.messages import topics
from msgs_config.messages.session import SESSION, make_session
from sim_node.node import SimNode
from sim_node.node_settings import NodeSettings

_PROGRESS_PERIOD = 0.1  # s between words on the progress
_NOTHING_GIVEN: Mapping[str, object] = {}
_NO_MAKERS: Mapping[str, Callable[[BusNode], ComposableNode]] = {}
_MAKERS: Mapping[str, Callable[[BusNode], ComposableNode]] = {
    topics.SIM_NODE: SimNode,
    topics.CONTROLLER_NODE: ControllerNode,
}

Progress = Callable[[int], None]
"""Is called with the number of ticks so far."""


def run_together(
    given: Mapping[str, Mapping[str, object]],
    directory: Path,
    progress: Progress = lambda ticks: None,
    makers: Mapping[str, Callable[[BusNode], ComposableNode]] = _NO_MAKERS,
) -> None:
    """Run a recorder and other nodes on a bus of this process, until one of them ends.

    Args:
        given: Parameters of each by its full name, such as `left/controller_node`, in the order of
            their turns; the recorder's among them, into whose directory they are recorded.
        directory: Where the logs go, as those of processes do.
        progress: Is told the last tick now and then.
        makers: Of nodes beside simulator and controller, by their names.

    A signal ends the nodes and completes the bag; not before the third one it is left as it is.

    Raises:
        ActuatedCharactersError: one of the nodes failed.
        RunError: it was interrupted by a signal, whose own handler raised nothing.
    """
    bus = Bus(partial(_log, directory / LOGS))
    places: dict[str, InProcessNode] = {}
    for full_name, parameters in given.items():
        namespace, _, name = full_name.rpartition("/")
        places[full_name] = bus.node(name, parameters, namespace)
    recording = places.pop(topics.RECORDER_NODE)
    with (
        signals_held(most=2) as stop,
        _recorder(recording, progress, stop) as recorder,
    ):
        run_made(recorder, places.values(), makers, stop)
    if stop:
        raise RunError("the run was interrupted by a signal")


def run_made(
    listener: ComposableNode,
    places: Iterable[InProcessNode],
    makers: Mapping[str, Callable[[BusNode], ComposableNode]],
    stop: StopFlag,
) -> None:
    """Make nodes at their places, beside one that is there already, and run all until one ends.

    Those beside simulator and controller have their `makers`, by their names.

    Raises:
        ActuatedCharactersError: one of the nodes failed.
    """
    makers = {**_MAKERS, **makers}
    with ExitStack() as at_end:
        nodes: list[ComposableNode] = [listener]
        for place in places:
            nodes.append(makers[place.get_name()](place))
            at_end.callback(nodes[-1].destroy_node)
        run_nodes(nodes, stop)


def run_in_process(
    plan: RunPlan,
    directory: Path,
    *,
    write_bag: bool = True,
    progress: Progress = lambda ticks: None,
    recording: Mapping[str, object] = _NOTHING_GIVEN,
    inputs: PlannedInputs = NO_INPUTS,
    fork: Mapping[str, object] | None = None,
    resets: int = 0,
    make_sender: Callable[[BusNode], ComposableNode] = PerturbationNode,
) -> None:
    """Run the nodes of a run over topics on a bus of this process; all else is as there.

    They send the same messages in the same order, so the bag differs in wall times alone.
    `make_sender` makes the node that sends what was planned.

    Raises:
        ConfigurationError: the simulator would pause at a fault.
        ActuatedCharactersError: one of the nodes failed, or the simulator rejected an input.
    """
    settings = NodeSettings.of(plan.simulator)
    for name, action in (("on_fault", settings.on_fault), ("on_timeout", settings.on_timeout)):
        if action == "pause":
            raise ConfigurationError(
                f"parameter '{name}' is pause, after which nobody could resume a simulator whose "
                "services are in this process alone; set it to abort"
            )
    recording = {**recording, "directory": str(directory), "write_bag": write_bag}
    senders = plan_senders(directory, inputs, recording, fork)
    given: dict[str, Mapping[str, object]] = {
        "recorder": {**recording, "progress_period": _PROGRESS_PERIOD},
        **senders,
        "controller_node": plan.controller,
        "sim_node": plan.simulator,
    }
    for name, parameters in given.items():
        write_parameters(directory, name, parameters)
    session = {SESSION.name: make_session("/sim_node")}
    awaited = {"controller_node": 2 + len(senders), "sim_node": 2 + (fork is not None)}
    run_together(
        {
            name: {**parameters, **session}
            | ({"wait_for_subscribers": awaited[name]} if name in awaited else {})
            for name, parameters in given.items()
        },
        directory,
        progress,
        makers=dict.fromkeys(senders, make_sender),
    )
    check_recorded(directory, plan.ticks - resets, inputs if fork is None else None)


@contextmanager
def _recorder(
    node: InProcessNode, progress: Callable[[int], object], stop: StopFlag
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
    with suppress(RecordingError) if stop else nullcontext():
        recorder.conclude()


def _log(folder: Path, name: str, severity: str, sentence: str) -> None:
    """Write what a node logs into its file, as rcutils does."""
    line = f"[{severity.upper().removesuffix('ING')}] [{time.time():.9f}] [{name}]: {sentence}\n"
    with (
        suppress(OSError),  # a full disk; the bag says so
        (folder / f"{name.replace('/', '.')}.log").open("a", encoding="utf-8") as file,
    ):
        file.write(line)
