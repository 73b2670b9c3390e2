"""Pushes that are planned before a run: sent in time, by a process that ends with the run."""

import json
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.runs.execution import run_in_process, run_over_topics
from actuated_characters.runs.in_process import ticks_in_process
from actuated_characters.runs.plan import Plan, make_plan
from actuated_characters.runs.planned_wrenches import (
    PlannedPush,
    planned_push,
    read_pushes,
    write_pushes,
)
from actuated_characters.runs.run_directory import prepare_directory, read_figures
from controller_node.parameters import make_controller
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from sim_node.parameters import make_character_setup, make_settings
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import character
from tests.support.ros import Processes

RATE = 240
TICKS = 60
HELD = 3  # ticks
CLOCK = TickClock(RATE)
HUMANOID = character("humanoid")
LINKS = [link.name for link in HUMANOID.links]
BEYOND = CLOCK.stamp_ns(1000)  # after the run
HAND = (0.01, -0.02, 0.03)  # m, in the link's frame
_FAMILY = "ACTUATED_CHARACTERS_TEST"  # an environment variable that all of a run's processes have

# which tick each begins with, in no order: the first one, one that overlaps another, the last one
PUSHES: list[tuple[int, str, tuple[float, ...], tuple[float, float, float] | None]] = [
    (40, "chest", (0.0, -150.0, 20.0, 1.0, -2.0, 3.0), None),
    (1, "chest", (100.0, 0.0, 0.0, 0.0, 0.0, 0.0), None),
    (41, "left_wrist", (0.0, 0.0, 30.0, 0.0, 0.5, 0.0), HAND),
    (60, "right_knee", (7.0, 8.0, 9.0, 0.0, 0.0, 0.0), None),
]
PLANNED = [PlannedPush(CLOCK.stamp_ns(tick), *what) for tick, *what in PUSHES]


def plan_of(ticks: int = TICKS, **simulator: object) -> Plan:
    given = {"rate": RATE, "wrench_duration": HELD / RATE} | simulator
    return make_plan("humanoid", ticks / RATE, {"reference": "hold"}, given, {})


def centre_of(link: str) -> FloatArray:
    """Its centre of mass (3,) in its frame, m."""
    return np.array(HUMANOID.links[LINKS.index(link)].inertial_pose.position)


def as_acting(
    tick: int, link: str, wrench: Sequence[float], point: Sequence[float] | None
) -> ExternalWrench:
    """A push as the simulation takes it."""
    where = centre_of(link) if point is None else np.array(point)
    return ExternalWrench(LINKS.index(link), np.array(wrench), where, tick, HELD)


def states_without_ros(plan: Plan, pushes: Sequence[ExternalWrench]) -> list[StampedState]:
    """The states of a plan when simulation and controller are called one after the other."""
    controller = make_controller(plan.character, plan.reference, plan.controller)
    role = make_character_setup(plan.character, plan.simulator)
    with Simulation([role], make_settings(plan.simulator)) as run:
        (actor,) = run.characters
        states = [actor.state]
        for _ in range(plan.ticks):
            effort, _ = controller.compute_effort(states[-1], states[0].stamp_ns)
            run.step([effort], [[push for push in pushes if push.acts_at(run.tick)]])
            states.append(actor.state)
    return states


def living(mark: str) -> list[int]:
    """Processes that were started with a mark in their environment, and live."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                if mark.encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
            except OSError:  # it has ended, or is somebody else's
                continue
    return found


@dataclass(frozen=True)
class Made:
    """A run with pushes over topics, and what it has left."""

    directory: Path
    recording: Recording
    summary: dict[str, Any]
    most_alive: int  # of its processes at once
    left: list[int]  # of them, after it


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Made:
    directory, mark = tmp_path_factory.mktemp("pushed") / "run", uuid.uuid4().hex
    prepare_directory(directory, overwrite=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("ROS_DOMAIN_ID", raising=False)
        patch.setenv(_FAMILY, mark)
        alive: list[int] = []
        run_over_topics(
            plan_of(),
            directory,
            write_bag=True,
            progress=lambda _: alive.append(len(living(mark))),
            pushes=PLANNED,
        )
    summary, _ = read_figures(directory)
    return Made(directory, read_recording(directory), summary, max(alive), living(mark))


# A run with pushes


@pytest.mark.slow
def test_each_push_acts_from_exactly_its_tick_for_the_duration(pushed: Made) -> None:
    applied = pushed.recording.applied_wrench

    said = {}
    for tick, wrenches in enumerate(applied, start=1):
        assert wrenches is not None
        rows = zip(
            wrenches.links, wrenches.wrenches.tolist(), wrenches.points.tolist(), strict=True
        )
        said[tick] = sorted((link, tuple(wrench), tuple(point)) for link, wrench, point in rows)

    expected = {
        tick: sorted(
            (link, wrench, tuple(centre_of(link).tolist()) if point is None else point)
            for first, link, wrench, point in PUSHES
            if first <= tick < first + HELD
        )
        for tick in range(1, TICKS + 1)
    }
    assert said == expected
    assert [tick for tick in said if said[tick]] == [1, 2, 3, 40, 41, 42, 43, 60]


@pytest.mark.slow
def test_the_states_are_those_of_one_process_with_the_same_pushes_to_the_bit(pushed: Made) -> None:
    acting = [as_acting(*push) for push in PUSHES]

    expected = states_without_ros(plan_of(), acting)

    recording = pushed.recording
    assert recording.stamps_ns.tolist() == [state.stamp_ns for state in expected]
    for row, state in enumerate(expected):
        assert recording.position[row].tobytes() == state.position.tobytes(), row
        assert recording.velocity[row].tobytes() == state.velocity.tobytes(), row


@pytest.mark.slow
def test_the_states_are_those_without_pushes_until_the_first_one_acts(pushed: Made) -> None:
    alone = states_without_ros(plan_of(), [])

    first = pushed.recording.velocity[1] - alone[1].velocity
    assert pushed.recording.position[0].tobytes() == alone[0].position.tobytes()
    assert np.abs(first).max() > 0.01


@pytest.mark.slow
def test_a_run_in_one_process_takes_the_same_pushes(pushed: Made, tmp_path: Path) -> None:
    prepare_directory(tmp_path / "run", overwrite=False)

    run_in_process(plan_of(), tmp_path / "run", progress=lambda _: None, pushes=PLANNED)

    summary, _ = read_figures(tmp_path / "run")
    assert summary["state_hash"] == pushed.summary["state_hash"]


@pytest.mark.slow
def test_nothing_is_left_behind_but_what_was_planned(pushed: Made) -> None:
    assert pushed.most_alive == 4
    assert pushed.left == []
    assert_same(read_pushes(pushed.directory / "parameters" / "pushes.json"), PLANNED)
    assert (pushed.directory / "logs" / "pusher.log").read_text() == ""


def test_a_push_for_a_time_after_the_run_never_acts() -> None:
    plan = plan_of(5)
    late = PlannedPush(BEYOND, "chest", (100.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    ticks = list(ticks_in_process(plan, [late]))

    expected = states_without_ros(plan, [])[1:]
    following = [tick.following.position.tobytes() for tick in ticks]
    assert following == [state.position.tobytes() for state in expected]


# Planning


@pytest.mark.parametrize(
    ("time", "tick"),
    [(0.0, 1), (0.1, 25), (0.1 + 1e-9, 25), (0.103, 26), (39 / RATE, 40), (0.2479, 60)],
)
def test_a_push_is_planned_for_the_tick_nearest_to_its_time(time: float, tick: int) -> None:
    push = planned_push(plan_of(), "chest", (1.0, 2.0, 3.0), time)

    expected = PlannedPush(CLOCK.stamp_ns(tick), "chest", (1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
    assert push == expected


WRONG_PLANS: dict[str, tuple[str, tuple[float, float, float], float, list[str]]] = {
    "unknown link": ("chset", (1.0, 0.0, 0.0), 0.0, ["'chset'", "did you mean 'chest'?"]),
    "no finite force": ("chest", (1.0, np.nan, 0.0), 0.0, ["'chest'", "nan", "finite"]),
    "before the run": ("chest", (1.0, 0.0, 0.0), -0.1, ["-0.1 s", "0.25 s"]),
    "at its end": ("chest", (1.0, 0.0, 0.0), 0.25, ["less than 0.25 s"]),
    "at no time": ("chest", (1.0, 0.0, 0.0), np.nan, ["nan s"]),
}


@pytest.mark.parametrize("wrong", WRONG_PLANS)
def test_a_push_that_cannot_act_is_refused_in_a_line(wrong: str) -> None:
    link, force, time, expected = WRONG_PLANS[wrong]

    with pytest.raises(ConfigurationError) as caught:
        planned_push(plan_of(), link, force, time)

    line = str(caught.value)
    assert "\n" not in line and all(part in line for part in expected)


# Its file


def test_what_is_written_is_read_to_the_bit(tmp_path: Path) -> None:
    exact = PlannedPush(2**53 + 1, "chest", (0.1, 1e-300, -1e300, 1 / 3, 0.0, -0.0), HAND)

    write_pushes(tmp_path / "pushes.json", [*PLANNED, exact])

    assert_same(read_pushes(tmp_path / "pushes.json"), [*PLANNED, exact])


def assert_same(pushes: Sequence[PlannedPush], others: Sequence[PlannedPush]) -> None:
    in_order = sorted(others, key=lambda push: push.stamp_ns)
    for one, other in zip(pushes, in_order, strict=True):
        said, expected = one.arrays(), other.arrays()
        assert (said.stamp_ns, said.links) == (expected.stamp_ns, expected.links)
        assert said.wrenches.tobytes() == expected.wrenches.tobytes()
        assert said.points.tobytes() == expected.points.tobytes()


WRONG_FILES: dict[str, str | bytes] = {
    "no JSON": "tomorrow",
    "no list": json.dumps({"stamp_ns": 1}),
    "a list of numbers": "[1, 2]",
    "another key": json.dumps([{"stamp_ns": 1, "link": "chest", "force": [1, 2, 3]}]),
    "a key less": json.dumps([{"stamp_ns": 1, "link": "chest"}]),
    "no text": b"\xff\xfe\x00",
}


@pytest.mark.parametrize("wrong", WRONG_FILES)
def test_a_file_that_holds_no_pushes_is_refused_in_a_line(tmp_path: Path, wrong: str) -> None:
    content = WRONG_FILES[wrong]
    file = tmp_path / "pushes.json"
    file.write_bytes(content.encode() if isinstance(content, str) else content)

    with pytest.raises(RecordingError) as caught:
        read_pushes(file)

    line = str(caught.value)
    assert line.startswith(f"{file} holds no pushes: ") and "\n" not in line


def test_a_pusher_without_its_file_ends_with_one_clear_line(
    processes: Processes, tmp_path: Path
) -> None:
    file = tmp_path / "nowhere.json"

    node = processes.python(
        "-m", "actuated_characters.runs.perturbation_main", "--ros-args", "-p", f"file:={file}"
    )

    assert node.wait() == 1
    (line,) = node.stderr.splitlines()
    assert line.startswith(f"error: {file} holds no pushes: ")
