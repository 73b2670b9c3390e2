"""What players send of a bag, the files of recorded characters, and what is told meanwhile."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.recording import CommandArrays, NodeParameters, Recording
from actuated_characters.replay.players.character_files import write_character
from actuated_characters.replay.players.controller_parameters import (
    first_parameters,
    parameter_changes,
)
from actuated_characters.replay.players.player import Player
from actuated_characters.replay.players.simulator_inputs import make_inputs
from msgs_config.bus.in_process import Bus
from msgs_config.character.file import shipped_characters
from msgs_config.character.loading import load_character
from msgs_config.errors import RecordingError, RunError
from tests.support.bags import make_run
from tests.support.physics import DATA, character
from tests.support.recordings import recording_of, with_parameters

TICKS = 24


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    made = make_run("humanoid", TICKS / 240.0, {"reference": "clip", "clip": "walk"})
    return recording_of(made, tmp_path_factory.mktemp("walk"))


# The inputs of a simulator


def sent_to(recording: Recording, legs: bool, value: float) -> CommandArrays:
    """A command to the first four of the commanded joints, or to the others."""
    joints = list(recording.parameters["commanded_joints"])
    entries = np.flatnonzero(recording.layout.mask(joints[:4] if legs else joints[4:]))
    names = tuple(recording.layout.dof_names[entry] for entry in entries)
    return CommandArrays(names, np.full(len(names), value), 0)


def always_commanding(recording: Recording, *commands: CommandArrays) -> Recording:
    return replace(recording, commands=(commands,) * len(recording.stamps_ns))


def test_commands_are_sent_until_they_cover_the_tick(walk: Recording) -> None:
    sent = [sent_to(walk, legs, 1.0) for legs in (True, True, False, True)]
    unknown = CommandArrays(("nose",), np.ones(1), 0)
    not_finite = sent_to(walk, legs=True, value=np.nan)

    (inputs,) = make_inputs([always_commanding(walk, unknown, not_finite, *sent)])

    assert not inputs.are_applied
    assert inputs.commands == ((sent[0], sent[2]),) * TICKS  # a repeated one is not needed


def test_after_a_conflict_the_commands_that_were_asked_for_again_count(walk: Recording) -> None:
    # the second command is another sender's, at which the simulator pauses
    sent = [sent_to(walk, *each) for each in ((True, 1.0), (True, 2.0), (False, 3.0))]

    (inputs,) = make_inputs([always_commanding(walk, *sent)])

    assert inputs.commands[0] == (sent[1], sent[2])


def test_one_tick_without_its_commands_lets_the_applied_efforts_decide(walk: Recording) -> None:
    lacking = (*walk.commands[:10], (), *walk.commands[11:])

    (inputs,) = make_inputs([replace(walk, commands=lacking)])

    assert inputs.are_applied
    for tick in (0, 10, TICKS - 1):
        (sent,) = inputs.commands[tick]
        entries = walk.layout.indices(sent.names)
        assert sent.efforts.tobytes() == walk.effort[tick, entries].tobytes()


def test_a_recording_that_cannot_be_sent_says_why(walk: Recording) -> None:
    pushed = replace(walk, pushes_sent=2, applied_wrench=())
    effort = walk.effort.copy()
    effort[3, 10] = np.nan
    silent = replace(walk, effort=effort, commands=((),) * (TICKS + 1))

    for recording, reason in (
        (pushed, "2 messages on 'external_wrench'"),
        (with_parameters(walk, commanded_joints=[]), "without --through-topics"),
        (silent, "tick 4 of the recording has neither"),
    ):
        with pytest.raises(RecordingError, match=reason):
            make_inputs([recording])


# The parameters of a controller


def settings_of(**values: float | None) -> dict[str, Any]:
    return {"gains.a.p": 1.0, "effort_limit.a": None, **values}


def test_a_controllers_parameters_are_those_before_its_first_answer(walk: Recording) -> None:
    stamps = walk.stamps_ns.tolist()
    configuration = (
        NodeParameters(settings_of(), None),
        NodeParameters(settings_of(**{"gains.a.p": 2.0}), None),
        NodeParameters(settings_of(**{"gains.a.p": 3.0}), stamps[5]),
        NodeParameters(settings_of(**{"gains.a.p": 4.0, "effort_limit.a": 9.0}), stamps[5]),
        NodeParameters(settings_of(**{"gains.a.p": 4.0, "effort_limit.a": None}), stamps[9]),
    )
    changing = replace(walk, controller=configuration)

    assert first_parameters(changing) == {"gains.a.p": 2.0, "effort_limit.a": np.inf}
    assert parameter_changes(changing) == {
        5: [{"gains.a.p": 3.0}, {"gains.a.p": 4.0, "effort_limit.a": 9.0}],
        9: [{"effort_limit.a": np.inf}],
    }
    assert parameter_changes(changing, ["gains.a.p"])[5] == [{"effort_limit.a": 9.0}]


def test_a_controller_that_is_not_in_the_bag_cannot_be_started(walk: Recording) -> None:
    with pytest.raises(RecordingError, match="use --no-start"):
        first_parameters(replace(walk, controller=()))


# Characters as files


@pytest.mark.parametrize("name", [*shipped_characters(), str(DATA / "turned_frames_y_up.yaml")])
def test_a_character_that_is_written_is_the_same_when_it_is_read(name: str, tmp_path: Path) -> None:
    original = load_character(name)

    again = load_character(str(write_character(tmp_path / "new", original)))

    for field in ("name", "links", "gains", "clips", "rest_position", "feet"):
        assert getattr(again, field) == getattr(original, field)
    for field in ("scale", "fixed_base", "inertia_from_file", "self_collision"):
        assert getattr(again.loading, field) == getattr(original.loading, field)


def test_limits_are_lifted_and_nothing_else(tmp_path: Path) -> None:
    original = character("humanoid")

    again = load_character(str(write_character(tmp_path, original, lift_limits=True)))

    assert (again.effort_limits() >= 1e300).all()
    assert again.gains == original.gains and again.mass == original.mass
    assert again.rest_position == original.rest_position


# Waiting


def test_what_is_waited_for_is_told_every_two_seconds_and_then_given_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 100.0
    monkeypatch.setattr("actuated_characters.replay.players.player.time.monotonic", lambda: now)
    player = Player(Bus().node("player", {}))
    player.stop = False
    told, waiting = [], player.wait(lambda: False, lambda: "an answer")
    for now in np.arange(100.0, 160.1, 0.5):  # the clock
        next(waiting)
        told += [now] * bool(capsys.readouterr().out)

    assert told[0] <= 102.5 and told[-1] >= 157.5 and np.diff(told).max() <= 2.5
    now = 160.5
    with pytest.raises(RunError, match=r"^waited 60 s for an answer$"):
        next(waiting)
