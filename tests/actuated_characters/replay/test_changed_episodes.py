"""Parameters that were changed at resets: recorded, replayed, forked, and told, to the last bit."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from rclpy.context import Context

from actuated_characters.bags.keyframes import find_keyframes
from actuated_characters.bags.recording import Recording, read_recording, read_recordings
from actuated_characters.cli import main
from actuated_characters.metrics.equation_of_motion import EquationOfMotion
from actuated_characters.metrics.recording_metrics import contact_series, measure_recording
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_commands, replay_states
from actuated_characters.report.events import change_events
from actuated_characters.viewer.recorded.plots import curves
from controller_node import parameters as controller
from controller_node.references.factory import make_motion
from msgs_config.messages.configuration import SINCE
from tests.support.changed_episodes import (
    BEGINS,
    MOON,
    TICKS,
    ChangedEpisodes,
    record_changed_episodes,
)
from tests.support.physics import character
from tests.support.runs import summary_of

RATE = 240  # Hz
pytestmark = [pytest.mark.slow, pytest.mark.sharing]


@pytest.fixture(scope="module")
def folder(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    del domain  # the nodes inherit it
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def changed(folder: Path, context: Context) -> ChangedEpisodes:
    return record_changed_episodes(folder, context)


@pytest.fixture(scope="module")
def run(changed: ChangedEpisodes) -> Path:
    return changed.run


@pytest.fixture(scope="module")
def recording(run: Path) -> Recording:
    return read_recording(run)


def nothing(*_: object) -> None:
    """Hears, and does nothing."""


def begin_of(clip: str) -> np.ndarray:
    """The position (n,) in which a clip of the humanoid begins."""
    humanoid = character("humanoid")
    given = {"character": "humanoid", "reference": "clip", "clip": clip}
    values = controller.resolve_for(humanoid, given)
    return make_motion(humanoid, values).first_state().position


def test_each_episode_begins_where_its_reference_does(recording: Recording) -> None:
    assert tuple(recording.episode_rows) == BEGINS

    for row, clip in zip(BEGINS[:4], ("walk", "run", "run", "walk"), strict=True):
        np.testing.assert_allclose(recording.position[row], begin_of(clip), atol=1e-9)
        assert (recording.parameters_at(row)["initial_position"] == begin_of(clip)).all()


def test_the_simulator_says_before_each_episode_what_holds_in_it(
    changed: ChangedEpisodes, recording: Recording
) -> None:
    told = [json.loads(message.data) for message in changed.configurations]

    assert [each[SINCE] for each in told] == [
        None,
        recording.stamps_ns[BEGINS[1] - 1],
        recording.stamps_ns[BEGINS[3] - 1],
        recording.stamps_ns[BEGINS[4] - 1],
    ]
    shown = [(p["gravity"], p["friction"]) for p in (each["parameters"] for each in told[:3])]
    assert shown == [(9.81, 0.9), (MOON, 0.4), (9.81, 0.4)]
    assert told[0]["probe"] != told[1]["probe"]


def residual(recording: Recording, row: int, gravity: float) -> float:
    """The residual of the equation of motion in the tick that begins in a row, as a share."""
    humanoid, found = recording.character, recording.contacts[row]
    assert found is not None
    names, contacts = [link.name for link in humanoid.links], np.zeros((len(humanoid.links), 6))
    for link, wrench in zip(found.links, found.wrenches, strict=True):
        contacts[names.index(link)] += wrench
    position, velocity = recording.position[row], recording.velocity[row : row + 2]
    equation = EquationOfMotion(humanoid, gravity, 240)
    return equation.balance(
        position, velocity[0], recording.effort[row], velocity[1], contacts
    ).relative


def test_characters_move_by_the_gravity_of_their_episode(recording: Recording) -> None:
    for begin, end in pairwise((*BEGINS, TICKS)):
        gravity = recording.parameters_at(begin)["gravity"]
        for row in range(begin, end - 1, 5):
            assert residual(recording, row, gravity) < 1e-4
            assert residual(recording, row, gravity + 1.0) > 1e-3


def test_a_steered_episode_hears_velocities_from_its_first_state_on(
    changed: ChangedEpisodes, recording: Recording
) -> None:
    stamps = recording.stamps_ns
    assert changed.velocities_ns == [stamps[BEGINS[4]], stamps[BEGINS[4] + 4]]
    begin, last = recording.reference_position[BEGINS[4]], recording.reference_position[TICKS - 1]
    assert np.linalg.norm((last - begin)[:2]) > 0.01  # m


def test_a_ragdoll_is_not_driven_and_neither_is_its_root(recording: Recording) -> None:
    assert recording.effort[: BEGINS[1] - 1, :6].any(axis=1).all()
    assert not recording.effort[BEGINS[2] : BEGINS[3] - 1].any()
    assert recording.effort[BEGINS[3] :, :6].any()


@pytest.mark.parametrize("way", ["in process", "commands", "states"])
def test_a_replay_is_identical(run: Path, recording: Recording, way: str) -> None:
    if way == "in process":
        result = replay(read_recordings(run))
        assert result.identical and result.episodes == len(BEGINS)
    elif way == "commands":
        result = replay_commands(run, progress=nothing, tell=nothing)
        assert result.identical and result.episodes == len(BEGINS)
    else:
        assert replay_states(run, progress=nothing, tell=nothing).identical


def test_a_fork_without_a_change_is_the_original(run: Path) -> None:
    directory = run.parent / "forked"
    at = (BEGINS[4] + 10) / RATE

    options = ["--at", f"{at!r}", "--from-start", "--output", str(directory)]
    assert main(["fork", str(run), *options]) == 0

    assert summary_of(directory)["state_hash"] == summary_of(run)["state_hash"]


def test_from_any_keyframe_all_goes_on_as_it_did(run: Path, recording: Recording) -> None:
    """With other parameters in force, and with changes and resets yet to come."""
    keyframes = find_keyframes(run / "bag")
    assert keyframes is not None
    rows = [int(np.searchsorted(recording.stamps_ns, each.stamp_ns)) for each in keyframes.places]
    assert rows == [144]

    for row in rows:
        directory = run.parent / f"from-{row}"
        options = ["--at", f"{row / RATE!r}", "--output", str(directory)]
        assert main(["fork", str(run), *options]) == 0, row
        part = read_recording(directory)
        assert part.stamps_ns.tolist() == recording.stamps_ns[row:].tolist()
        assert part.position.tobytes() == recording.position[row:].tobytes()
        assert part.velocity.tobytes() == recording.velocity[row:].tobytes()
        assert part.effort.tobytes() == recording.effort[row:].tobytes()
        assert main(["replay", str(directory)]) == 0, row


def test_changes_are_listed(recording: Recording) -> None:
    events = change_events(recording)
    found = [tuple(event.facts.values()) for event in events]

    changes: list[tuple[str, object, object]] = [
        ("gravity", 9.81, MOON),
        ("gravity", MOON, 9.81),
        ("friction", 0.9, 0.4),
        ("clip", "walk", "run"),
        ("behaviour", "tracking", "ragdoll"),
        ("library", [], ["walk"]),
    ]
    assert [change for change in changes if change not in found] == []
    times = {event.facts["name"]: event.start for event in events}
    assert times["solver_iterations"] == pytest.approx((BEGINS[3] - 1) / 240)


def test_info_and_report_tell_of_changes(run: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(run), "--ticks", "--json"]) == 0
    told = json.loads(capfd.readouterr().out)["runs"][0]["events"]
    assert {"name": "gravity", "before": 9.81, "after": MOON} in [each["facts"] for each in told]
    page = run.parent / "page"
    assert main(["report", str(run), "--output", str(page)]) == 0
    assert f"gravity: 9.81 to {MOON}" in (page / "index.html").read_text()


def test_a_cut_of_one_gravity_has_one_weight(recording: Recording) -> None:
    whole, _ = measure_recording(recording)
    cut, _ = measure_recording(recording.rows(slice(BEGINS[1], BEGINS[3])))

    assert whole["body_weight_n"] is None
    assert cut["body_weight_n"] == pytest.approx(recording.character.mass * MOON)


def test_loads_are_shares_of_the_weight_of_their_episode(recording: Recording) -> None:
    loads = curves(recording)["force / weight"][1:]
    force = contact_series(recording.character, recording.contacts)
    assert force is not None

    for begin, end, gravity in ((0, BEGINS[1], 9.81), (BEGINS[1], BEGINS[3] - 1, MOON)):
        shares = force.vertical_force[begin:end] / (gravity * recording.character.mass)
        assert np.nanmax(shares) > 0.5
        np.testing.assert_allclose(loads[begin:end], shares)
