"""Replays a bag through ROS topics: in the controller's place, or in the simulator's."""

import signal
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.replay.comparison import ReplayResult
from actuated_characters.replay.players.files import write_character, write_urdf
from actuated_characters.replay.players.findings import CommandFindings, compare_commands
from actuated_characters.replay.players.main import COMMANDS, STATES
from actuated_characters.replay.players.processes import (
    Progress,
    Tell,
    session,
    start_player,
    wait_for_player,
)
from actuated_characters.replay.players.results import FoundStates, compare_found
from actuated_characters.replay.players.script import make_scripts, read_world
from actuated_characters.replay.players.steering import first_parameters
from actuated_characters.replay.world import simulator_values
from actuated_characters.runs.processes import Child
from msgs_config.errors import ConfigurationError, RunError
from msgs_config.messages import topics
from msgs_config.messages.session import SESSION, make_session
from msgs_config.shared_parameters import CHARACTER, PLACEMENT
from sim_node.parameters import CHARACTERS, WORLD_PARAMETERS

_OF_A_CHARACTER = (
    PLACEMENT.name,
    "commanded_joints",
    "initial_position",
    "initial_velocity",
)
_NOT_TO_BE_SET = (
    CHARACTER.name,
    PLACEMENT.name,
    SESSION.name,
    "rate",
    "wait_for_subscribers",
)
_APPLIED = (
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
    """Let a bag take the controller's place: it answers a simulator as one was answered then.

    The simulator is started with the parameters and the character that are in the bag.

    Args:
        path: A run's directory, or a bag.
        progress: Is told the number of states that have come.
        tell: Is told what is waited for, if it takes long.
        tolerance: Largest difference that is none, in rad, m, rad/s and m/s; None: not a bit.
        world: Which of the bag's worlds, where there are several; counted from 0.

    Raises:
        RecordingError: the bag cannot be read, or its world not be rebuilt.
        RunError: a process failed, and not because of what differed.
    """
    together, notes = read_world(path, world)
    scripts = make_scripts(together)
    applies = scripts[0].applies
    failure: RunError | None = None
    own = {SESSION.name: make_session(f"/{topics.SIM_NODE}")}
    with session() as run:
        file = run.directory / "states.npz"
        playing = {"recording": str(path.absolute()), "world": world, "states": str(file)}
        player = start_player(run, COMMANDS, playing | own)
        parameters = _simulator_parameters(run.directory, together, applies) | own
        simulator = run.start_node(topics.SIM_NODE, parameters)
        try:
            wait_for_player(player, [simulator], progress, tell)
        except RunError as error:
            failure = error
        found = _found_states(player, file, len(together))
    notes += [_APPLIED] if applies else []
    result = compare_found(together, found, tolerance, notes) if found else None
    if failure is not None and (result is None or result.identical):
        raise failure
    assert result is not None
    return result


def _simulator_parameters(
    directory: Path, together: Sequence[Recording], applies: bool
) -> dict[str, object]:
    """The recorded simulator's parameters, for one that waits for each command."""
    first = simulator_values(together[0])
    parameters: dict[str, object] = {each.name: first[each.name] for each in WORLD_PARAMETERS}
    terrain = together[0].world.terrain
    if terrain is not None:
        parameters["terrain"] = str(write_urdf(directory / "terrain.urdf", terrain))
    if together[0].world.characters:
        parameters[CHARACTERS.name] = [recording.world.name for recording in together]
    for number, recording in enumerate(together):
        prefix = f"{recording.world.name}." if recording.world.name else ""
        file = write_character(directory / f"{number}", recording.character, lift_limits=applies)
        values = simulator_values(recording)
        parameters[prefix + CHARACTER.name] = str(file)
        parameters |= {prefix + name: values[name] for name in _OF_A_CHARACTER}
    if applies:
        parameters["command_delay_ticks"] = 0
    return parameters | {
        "mode": "lockstep",
        "real_time_factor": 0.0,
        "max_ticks": len(together[0].effort),
        "wait_for_subscribers": 1,
        "lockstep_timeout": 0.0,
        "on_timeout": "abort",
        "on_fault": "abort",
        "wrench_duration": 1.0 / first.integer("rate"),  # each tick's pushes are sent for it alone
    }


def _found_states(player: Child, file: Path, characters: int) -> list[FoundStates]:
    """What a player has heard; nothing if it had not begun to listen."""
    player.end(signal.SIGINT)  # it may still wait for a simulator that has failed
    if not file.is_file():
        return []
    with np.load(file) as arrays:
        return [
            FoundStates(
                *(arrays[f"{what}_{number}"] for what in ("position", "velocity", "effort"))
            )
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
) -> CommandFindings:
    """Let a bag take the simulator's place: a controller answers what one has answered then.

    Args:
        path: A run's directory, or a bag.
        progress: Is told the number of states that are answered.
        tell: Is told what is waited for, if it takes long.
        character: The name of the recording to play, where there are several.
        settings: Parameters of `controller_node` in place of the recorded ones.
        start: Start the bag's own controller, in an unused ROS domain. Without it,
            another one is waited for on the present domain, in the character's namespace.

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
    with session(own=start) as run:
        file = run.directory / "commands.npz"
        playing: dict[str, object] = {
            "recording": str(path.absolute()),
            "character": recording.name,
            "commands": str(file),
            "steers": start,
            "fixed": sorted(settings),
            SESSION.name: make_session(f"/{topics.SIM_NODE}"),
        }
        others = []
        if start:
            parameters = first_parameters(recording) | settings
            parameters |= {
                CHARACTER.name: str(write_character(run.directory, recording.character)),
                "wait_for_subscribers": 1,
                SESSION.name: playing[SESSION.name],
            }
            others.append(run.start_node(topics.CONTROLLER_NODE, parameters))
        else:
            playing["start_patience"] = 0.0
        namespace = "" if start else recording.name
        player = start_player(run, STATES, playing, namespace)
        wait_for_player(player, others, progress, tell)
        with np.load(file) as arrays:
            return compare_commands(recording, arrays["commands"])
