"""Runs a planned fork, and says which of its balls have hit."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from actuated_characters.bags.forked_from import KEY
from actuated_characters.bags.recording import Recording
from actuated_characters.fork.node import ForkNode
from actuated_characters.fork.plan import ForkPlan
from actuated_characters.fork.script import Script
from actuated_characters.recorder.run_directory import PARAMETERS
from actuated_characters.replay.players.character_files import (
    write_character,
    write_known_terrain,
    write_terrain,
)
from actuated_characters.runs.execution import run_over_topics
from actuated_characters.runs.in_process import Progress, run_in_process
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.throw_hits import describe_hits, read_states
from msgs_config.character.loading import load_character
from msgs_config.errors import ActuatedCharactersError
from msgs_config.messages import topics
from msgs_config.messages.keyframe import write_keyframe
from msgs_config.parameters import Values
from msgs_config.shared_parameters import CHARACTER, RESUME_FROM


def run_fork(
    fork: ForkPlan,
    directory: Path,
    *,
    progress: Progress = lambda ticks: None,
    through_topics: bool = False,
    script: Script | None = None,
) -> None:
    """Run a fork in this process, or over topics; its directory, prepared, gets what a run's gets.

    A `script`, in this process alone, is sent in the place of what the fork repeats.

    Raises:
        ActuatedCharactersError: one of the nodes failed, or a state up to the fork is not the
            recorded one.
    """
    run = (
        run_over_topics
        if through_topics
        else partial(run_in_process, make_sender=partial(ForkNode, script=script))
    )
    run(
        with_files(fork.plan, fork.recording, directory / PARAMETERS),
        directory,
        write_bag=True,
        progress=lambda ticks: progress(max(ticks - fork.skipped, 0)),
        recording={KEY: fork.origin.to_json(), "sensors": list(fork.sensors)},
        inputs=fork.inputs,
        fork=fork.node,
        resets=fork.resets,
    )


def with_files(plan: RunPlan, recording: Recording, folder: Path) -> RunPlan:
    """A plan whose files have the recorded texts: today's files, or else some that are written."""
    terrain, both = recording.world.terrain, dict[str, str]()
    if not _is_unchanged(recording):
        both[CHARACTER.name] = str(write_character(folder, recording.character))
    simulator = both | write_terrain(folder, terrain)
    controller = both | write_known_terrain(folder, terrain, plan.controller)
    for given, raw, name in (
        (simulator, recording.keyframe, topics.SIM_NODE),
        (controller, recording.controller_keyframe, topics.CONTROLLER_NODE),
    ):
        given[RESUME_FROM.name] = write_keyframe(folder, name, raw)
    return replace(
        plan,
        simulator=Values(plan.simulator | simulator),
        controller=Values(plan.controller | controller),
    )


def _is_unchanged(recording: Recording) -> bool:
    """Whether the character's files are what they were."""
    then = recording.character
    try:
        today = load_character(str(recording.parameters[CHARACTER.name]))
    except ActuatedCharactersError:
        return False
    texts = [(each.file_text, each.loading.urdf_text) for each in (then, today)]
    return texts[0] == texts[1]


def describe_new_hits(fork: ForkPlan, directory: Path) -> Sequence[str]:
    """Of each new throw a few words on whether it hit; none where other balls may be there."""
    balls = fork.recording.balls[0] if fork.recording.balls else None
    if not fork.inputs.throws or fork.resets or (balls is not None and balls.names):
        return ()
    throws = [*fork.repeated_throws, *fork.inputs.throws]
    since = fork.skipped / fork.plan.simulation.rate_hz
    words = describe_hits(fork.plan, throws, read_states(directory), since)
    return words[len(fork.repeated_throws) :]
