"""Runs with pins: what is sent and when, one hash however they run, and forks while a pin acts."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from actuated_characters.bags.pins import own_pushes, pin_changes
from actuated_characters.bags.recording import Recording, read_recording, read_recordings
from actuated_characters.cli import main
from actuated_characters.fork.inputs import ForkPoint, recorded_stops
from actuated_characters.metrics.recording_metrics import pin_spans, push_spans
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_commands
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.planned.files import write_planned
from actuated_characters.runs.planned.pins import PlannedPin, read_pins
from actuated_characters.runs.planned.timeline import TimelineRun, plan_timeline
from msgs_config.errors import ActuatedCharactersError, RecordingError
from msgs_config.messages.clock import TickClock
from tests.support.recorded_nodes import record_pair_in_process
from tests.support.runs import run_plan, run_plan_here, summary_of

RATE = 240
CLOCK = TickClock(RATE)
RIGHT = {"at": 0.3, "until": 0.62, "link": "right_wrist", "point": "here", "force": 80}
LEFT = {"at": 0.4, "until": 5, "link": "left_wrist", "point": [0.3, 0.3, 1.1], "force": 60}
CONTENT: dict[str, Any] = {
    "duration": 1.0,
    "run": {"planner": "none"},
    "clips": [{"at": 0.0, "clip": "walk"}],
    "pushes": [
        {"at": 0.1, "link": "chest", "force": [40, 0, 0]},
        {"at": 0.7, "link": "chest", "force": [0, 30, 0]},
    ],
    "pins": [RIGHT, LEFT],
}


def planned(directory: Path, **changes: Any) -> TimelineRun:
    file = directory / "moves.yaml"
    file.write_text(yaml.safe_dump({**CONTENT, **changes}), encoding="utf-8")
    return plan_timeline(str(file), {"keyframe_period": 0.25}, {})


def tick(time: float) -> int:
    return CLOCK.stamp_ns(1 + round(time * RATE))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That of a run with pins."""
    folder = tmp_path_factory.mktemp("pinned")
    run = planned(folder)
    run_plan_here(run.plan, folder / "run", run.inputs)
    return folder


@pytest.fixture(scope="module")
def recording(folder: Path) -> Recording:
    return read_recording(folder / "run")


def assert_ends_alike(part: Recording, whole: Recording) -> None:
    count = len(part.stamps_ns)
    for name in ("position", "velocity"):
        assert getattr(part, name).tobytes() == getattr(whole, name)[-count:].tobytes(), name
    ends = [
        [(each.links, each.wrenches.tolist()) for each in one.applied_wrench[1 - count :] if each]
        for one in (part, whole)
    ]
    assert ends[0] == ends[1]


# What is planned


def test_each_pin_is_sent_and_let_go_at_its_tick(tmp_path: Path) -> None:
    pins = planned(tmp_path, duration=9).inputs.pins

    assert [(each.stamp_ns, each.link, each.force) for each in pins] == [
        (tick(0.4), "left_wrist", 60.0),
        (tick(5), "left_wrist", 0.0),
        (tick(0.3), "right_wrist", 80.0),
        (tick(0.62), "right_wrist", 0.0),
    ]
    write_planned(tmp_path / "pins.json", pins)
    assert read_pins(tmp_path / "pins.json") == sorted(pins, key=lambda each: each.stamp_ns)


def test_here_is_where_the_motion_has_the_link(tmp_path: Path) -> None:
    run = planned(tmp_path)
    (here, *_) = [each for each in run.inputs.pins if each.link == "right_wrist"]

    from msgs_config.character.dynamics import DynamicsModel

    model, character = DynamicsModel(run.plan.character), run.plan.character
    position = run.reference.sample(0.3).configuration.position
    model.update(position, np.zeros(character.layout.size))
    row = [link.name for link in character.links].index("right_wrist")
    assert list(here.place) == model.link_poses()[0][row].tolist()


def test_a_pin_that_follows_another_at_once_replaces_it(tmp_path: Path) -> None:
    after = {**LEFT, "at": 0.62, "until": 0.8, "link": "right_wrist"}

    pins = planned(tmp_path, pins=[after, RIGHT]).inputs.pins

    assert [(each.stamp_ns, each.force) for each in pins] == [
        (tick(0.3), 80.0),
        (tick(0.62), 60.0),
        (tick(0.8), 0.0),
    ]


def test_a_run_of_no_said_length_lasts_until_all_is_let_go(tmp_path: Path) -> None:
    assert planned(tmp_path, duration=None).plan.ticks == 6 * RATE


@pytest.mark.parametrize(
    ("pins", "sentence"),
    [
        ([{**LEFT, "link": "ear"}], "pins 1: .*'ear'"),
        ([{**LEFT, "at": 2}], "pins 1: at is 2 s; the run ends at 1 s"),
        ([{**LEFT, "until": 0.2}], "pins 1: until is 0.2; it must be later than 'at', 0.4 s"),
        ([{**LEFT, "force": 0}], "pins 1: force is 0"),
        ([{**LEFT, "point": "there"}], "pins 1: point is"),
        ([LEFT, {**LEFT, "at": 0.6}], "pins 2: at is 0.6; .* 5 s or later, when 'left_wrist' is"),
        ([{**LEFT, "torque": 1}], "torque"),
    ],
)
def test_what_cannot_be_pinned_is_refused_in_a_line(
    tmp_path: Path, pins: list[dict[str, Any]], sentence: str
) -> None:
    with pytest.raises(ActuatedCharactersError, match=sentence) as caught:
        planned(tmp_path, pins=pins)

    assert "\n" not in str(caught.value)


# What is recorded


def test_the_pins_in_force_and_their_forces_are_recorded_apart(recording: Recording) -> None:
    in_force = [() if each is None else each.links for each in recording.pins]
    assert in_force == [
        *[()] * 73,  # those of a tick are with the state after it
        *[("right_wrist",)] * 24,
        *[("right_wrist", "left_wrist")] * 53,
        *[("left_wrist",)] * 91,
    ]
    pushed = [row for row in range(RATE) if (push := own_pushes(recording, row)) and push.links]
    assert pushed == [*range(24, 48), *range(168, 192)]
    assert [span.link for span in push_spans(recording)] == ["chest", "chest"]
    held = {span.link: span for span in pin_spans(recording)}
    assert (held["right_wrist"].start, held["left_wrist"].start) == pytest.approx((0.3, 0.4))
    assert held["left_wrist"].duration == pytest.approx(0.6)
    pins = [each for row in range(RATE) if (each := pin_changes(recording, row))]
    assert [(each.stamp_ns, each.rows["right_wrist"][-1]) for each in (pins[0], pins[2])] == [
        (tick(0.3), 80.0),
        (tick(0.62), 0.0),
    ]
    forces = [
        np.linalg.norm(each.wrenches[-1, :3]) for each in recording.applied_wrench[100:] if each
    ]
    assert 0.0 < max(forces) <= 60.0 + 1e-9


def test_from_its_bag_it_is_the_same_run(folder: Path, recording: Recording) -> None:
    assert replay([recording]).identical
    run = planned(folder)
    ticks = ticks_in_process(run.plan, run.inputs.pushes, pins=run.inputs.pins)
    for row, each in enumerate(ticks, start=1):
        assert each.following.position.tobytes() == recording.position[row].tobytes()
    assert summary_of(folder / "run")["rejected_pins"] == 0


@pytest.mark.nightly
@pytest.mark.slow
def test_over_topics_composed_and_from_either_bag_it_has_one_hash(
    folder: Path, tmp_path: Path
) -> None:
    run = planned(tmp_path)
    expected = summary_of(folder / "run")["state_hash"]
    for name, options in {"apart": {}, "composed": {"composed": True}}.items():
        run_plan(run.plan, tmp_path / name, inputs=run.inputs, **options)
        assert summary_of(tmp_path / name)["state_hash"] == expected
        assert replay([read_recording(tmp_path / name)]).identical
    again = replay_commands(folder / "run", progress=lambda _: None, tell=lambda _: None)
    assert again.identical


@pytest.mark.slow
def test_of_two_characters_each_has_its_own_and_both_come_again(tmp_path: Path) -> None:
    def pins(link: str, *forces: float) -> list[PlannedPin]:
        at = zip((CLOCK.stamp_ns(5), CLOCK.stamp_ns(20)), forces, strict=True)
        end = (0.0, 0.0, -1.0)
        return [PlannedPin(stamp, link, (0.4, 0.1, -0.9), force, end) for stamp, force in at]

    run = record_pair_in_process(
        tmp_path, {"left": pins("rod", 3.0, 0.0), "right": pins("rod", 0.0, 5.0)}
    )

    left, right = read_recordings(run)
    for recording, ticks in ((left, range(5, 20)), (right, range(20, 41))):
        held = [row for row, each in enumerate(recording.pins) if each is not None]
        assert held == [tick for tick in ticks if tick <= 40]
    assert replay([left, right]).identical
    assert replay_commands(run, progress=lambda _: None, tell=lambda _: None).identical


# Forks


@pytest.mark.nightly
@pytest.mark.slow
def test_a_fork_from_a_keyframe_while_a_pin_acts_ends_as_the_run_did(
    folder: Path, recording: Recording
) -> None:
    forks = {"keyframe": (), "start": ("--from-start",), "topics": ("--through-topics",)}
    for name, options in forks.items():
        output = folder / name
        command = ["fork", str(folder / "run"), "--at", "0.7", *options]
        assert main([*command, "--output", str(output)]) == 0
        part = read_recording(output)
        assert len(part.stamps_ns) == (241 if name == "start" else 121)
        assert_ends_alike(part, recording)
        assert replay([part]).identical
    assert part.pins[0] is not None and part.pins[0].links == ("right_wrist", "left_wrist")
    again = replay_commands(output, progress=lambda _: None, tell=lambda _: None)
    assert again.identical


def test_a_fork_repeats_pins_only_where_they_were_recorded(recording: Recording) -> None:
    point = ForkPoint(180, RATE, with_later=False)
    stops = recorded_stops(recording, point)
    assert [(each.stamp_ns, each.link, each.force) for each in stops[1].pins] == [
        (tick(0.3), "right_wrist", 80.0),
        (tick(0.4), "left_wrist", 60.0),
        (tick(0.62), "right_wrist", 0.0),
    ]
    assert isinstance(stops[1].pins[0], PlannedPin)
    with pytest.raises(RecordingError, match=r"4 messages on 'pin'.*nothing on 'applied_pin'"):
        recorded_stops(replace(recording, pins=(), pins_sent=4), point)
