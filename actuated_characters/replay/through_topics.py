"""Replays a bag through ROS topics: in the controller's place, or in the simulator's."""

import signal
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.replay.command_comparison import CommandComparison, compare_commands
from actuated_characters.replay.comparison import QUANTITIES, ReplayResult, States, compare_world
from actuated_characters.replay.players.character_files import (
    write_character,
    write_known_terrain,
    write_terrain,
)
from actuated_characters.replay.players.controller_parameters import first_parameters
from actuated_characters.replay.players.main import CONTROLLER, SIMULATOR
from actuated_characters.replay.players.player import ANSWER_TIMEOUT
from actuated_characters.replay.players.processes import (
    Progress,
    Tell,
    child_processes,
    start_player,
    wait_for_player,
)
from actuated_characters.replay.players.simulator_inputs import make_inputs
from actuated_characters.replay.players.simulator_outputs import opponent_of
from actuated_characters.replay.world import read_world, simulator_values
from actuated_characters.runs.processes import Child, Children
from msgs_config.errors import ConfigurationError, RecordingError, RunError
from msgs_config.messages import topics
from msgs_config.messages.keyframe import write_keyframe
from msgs_config.messages.session import SESSION, make_session
from msgs_config.shared_parameters import CHARACTER, COLLISION, PLACEMENT, RESUME_FROM
from sim_node.initial_state import INITIAL_STATE, CharacterSettings
from sim_node.parameters import CHARACTERS, WORLD_PARAMETERS
from sim_node.physics.settings import SimulationSettings

_OF_A_CHARACTER = [
    COLLISION.name,
    PLACEMENT.name,
    *(each.name for each in CharacterSettings.declared() if each.name != INITIAL_STATE),
]
_NOT_TO_BE_SET = (
    CHARACTER.name,
    COLLISION.name,
    PLACEMENT.name,
    SESSION.name,
    "opponent",
    "rate",
    "wait_for_subscribers",
)
_APPLIED_EFFORTS_REMARK = (
    "not every tick has its commands in the bag, so the efforts that were really applied were "
    "sent, to a simulator in lockstep without effort limits and without delay"
)


def replay_commands(
    path: Path,
    *,
    progress: Progress,
    tell: Tell,
    tolerance: float | None = None,
    world: int = 0,
) -> ReplayResult:
    """Start a bag's simulator, answer its states with the bag's commands, and compare the states.

    Args:
        path: A run's directory, or a bag.
        progress: Is called with the number of states so far.
        tell: Is called with what is waited for, if it takes long.
        tolerance: See `compare_world`.
        world: Which of the bag's worlds, where there are several; counted from 0.

    Raises:
        RecordingError: the bag cannot be read, or its world cannot be built again.
        RunError: a process failed, and not because of what differed.
    """
    together, remarks = read_world(path, world)
    are_applied, failure = make_inputs(together)[0].are_applied, None
    session = {SESSION.name: make_session(f"/{topics.SIM_NODE}")}
    with child_processes() as children:
        file = children.directory / "states.npz"
        playing: dict[str, object] = {"world": world, "states": str(file)}
        player = start_player(children, CONTROLLER, path, playing | session)
        parameters = _simulator_parameters(children.directory, together, are_applied)
        simulator = children.start_node(topics.SIM_NODE, parameters | session)
        try:
            wait_for_player(player, [simulator], progress, tell)
        except RunError as error:
            failure = error  # matters only if nothing is found to differ
        found = _found_states(player, file, len(together))
    remarks += [_APPLIED_EFFORTS_REMARK] if are_applied else []
    result = compare_world(together, found, tolerance, remarks) if found else None
    if result is None or (failure is not None and result.identical):
        raise failure or RunError("the player has received no states")
    return result


def _simulator_parameters(
    directory: Path, together: Sequence[Recording], are_applied: bool
) -> dict[str, object]:
    """The recorded simulator's parameters, for one that waits for each command."""
    first = simulator_values(together[0])
    parameters: dict[str, object] = {each.name: first[each.name] for each in WORLD_PARAMETERS}
    parameters |= write_terrain(directory, together[0].world.terrain)
    if together[0].world.characters:
        parameters[CHARACTERS.name] = [recording.world.name for recording in together]
    for number, recording in enumerate(together):
        prefix = f"{recording.world.name}." if recording.world.name else ""
        file = write_character(
            directory / f"{number}", recording.character, lift_limits=are_applied
        )
        values = simulator_values(recording)
        parameters[prefix + CHARACTER.name] = str(file)
        parameters |= {prefix + name: values[name] for name in _OF_A_CHARACTER}
    if are_applied:
        if together[0].keyframe is not None and first["command_delay_ticks"]:
            raise RecordingError(
                "the recording begins with a keyframe, in which late commands are on their way, "
                "and not every tick has its commands: replay it without --through-topics"
            )
        parameters["command_delay_ticks"] = 0
    parameters[RESUME_FROM.name] = write_keyframe(directory, topics.SIM_NODE, together[0].keyframe)
    return parameters | {
        "mode": "lockstep",
        "real_time_factor": 0.0,
        "max_ticks": len(together[0].effort),
        "wait_for_subscribers": 1,
        "lockstep_timeout": 0.0,
        "on_timeout": "abort",
        "on_fault": "abort",
        "wrench_duration": 1.0
        / SimulationSettings.of(first).rate_hz,  # each tick's pushes are sent for it alone
    }


def _found_states(player: Child, file: Path, characters: int) -> list[States]:
    """The states that a player has received; none if it had not begun to listen."""
    player.end(signal.SIGINT)  # it may still wait for a simulator that has failed
    if not file.is_file():
        return []
    with np.load(file) as arrays:
        return [
            {quantity: arrays[f"{quantity}_{number}"] for quantity in QUANTITIES}
            for number in range(characters)
        ]


def replay_states(
    path: Path,
    *,
    progress: Progress,
    tell: Tell,
    character: str | None = None,
    settings: Mapping[str, object] | None = None,
    start: bool = True,
) -> CommandComparison:
    """Let a controller answer a bag's states, and compare its commands with the bag's.

    The arguments are those of `replay_commands`, and the `character` to play, where there are
    several; `settings` are parameters of `controller_node` in place of the recorded ones. `start`
    starts the bag's controller, in a ROS domain that no other node is in; without it, one that the
    user starts is waited for in the present domain, in the character's namespace.

    Raises:
        RecordingError: the bag cannot be read, or it has no commands.
        ConfigurationError: a parameter is not to be set.
        RunError: a process failed, or no answer came.
    """
    recording = read_recording(path, character)
    settings = dict(settings or {})
    for name in _NOT_TO_BE_SET:
        if name in settings:
            raise ConfigurationError(f"parameter '{name}' is set by the recording")
    if start and recording.keyframe is not None and recording.controller_keyframe is None:
        raise RecordingError(
            "the recording begins with a keyframe of the simulator, and has none of the controller"
        )
    if settings and recording.controller_keyframe is not None:
        raise ConfigurationError(
            "the recording begins with a keyframe, in which its controller has the parameters of "
            "then; --set is for recordings that begin with their run"
        )
    session = {SESSION.name: make_session(f"/{topics.SIM_NODE}")}
    with child_processes(own=start) as children:
        others = []
        # A started controller may be anywhere, unless it listens to the namespace beside its own.
        namespace = "" if start and not opponent_of(recording) else recording.name
        if start:
            parameters = _controller_parameters(children.directory, recording) | settings | session
            others.append(_start_controller(children, parameters, namespace))
        file = children.directory / "commands.npz"
        playing = _player_parameters(recording, settings, start) | {"commands": str(file)} | session
        player = start_player(children, SIMULATOR, path, playing, namespace)
        wait_for_player(player, others, progress, tell)
        with np.load(file) as arrays:
            return compare_commands(recording, arrays["commands"])


def _start_controller(
    children: Children, parameters: Mapping[str, object], namespace: str
) -> Child:
    remap = ["-r", f"__ns:=/{namespace}"] if namespace else []
    return children.start_node(topics.CONTROLLER_NODE, parameters, *remap, any_node=True)


def _player_parameters(
    recording: Recording, settings: Mapping[str, object], start: bool
) -> dict[str, object]:
    """The parameters of a player in the simulator's place."""
    return {
        "character": recording.name,
        "repeat_requests": start,
        "fixed": sorted(settings),
        "start_timeout": ANSWER_TIMEOUT if start else 0.0,
    }


def _controller_parameters(directory: Path, recording: Recording) -> dict[str, object]:
    """The recorded controller's parameters, for one that waits for the player."""
    own_files = {
        CHARACTER.name: str(write_character(directory, recording.character)),
        RESUME_FROM.name: write_keyframe(
            directory, topics.CONTROLLER_NODE, recording.controller_keyframe
        ),
    }
    parameters = first_parameters(recording)
    own_files |= write_known_terrain(directory, recording.world.terrain, parameters)
    return parameters | own_files | {"wait_for_subscribers": 1}
