"""Pushes that are planned before a run: sent in time, by a process that ends with the run."""

import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.files import write_planned
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.throws import PlannedThrow, read_throws
from actuated_characters.runs.planned.wrenches import (
    PlannedPush,
    plan_push,
    read_pushes,
)
from controller_node.parameters import make_controller
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.physics import character
from tests.support.ros import Processes, SimulatorClient
from tests.support.runs import family, run_plan

RATE = 240
TICKS = 60
HELD = 3  # ticks
CLOCK = TickClock(RATE)
HUMANOID = character("humanoid")
LINKS = [link.name for link in HUMANOID.links]
BEYOND = CLOCK.stamp_ns(1000)  # after the run
HAND = (0.01, -0.02, 0.03)  # m, in the link's frame

# which tick each begins with, in no order: the first one, one that overlaps another, the last one
PUSHES: list[tuple[int, str, tuple[float, ...], tuple[float, float, float] | None]] = [
    (40, "chest", (0.0, -150.0, 20.0, 1.0, -2.0, 3.0), None),
    (1, "chest", (100.0, 0.0, 0.0, 0.0, 0.0, 0.0), None),
    (41, "left_wrist", (0.0, 0.0, 30.0, 0.0, 0.5, 0.0), HAND),
    (60, "right_knee", (7.0, 8.0, 9.0, 0.0, 0.0, 0.0), None),
]
PLANNED = [PlannedPush(CLOCK.stamp_ns(tick), *what) for tick, *what in PUSHES]


def plan_of(ticks: int = TICKS, **simulator: object) -> RunPlan:
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


def states_without_ros(plan: RunPlan, pushes: Sequence[ExternalWrench]) -> list[StampedState]:
    """The states of a plan when simulation and controller are called one after the other."""
    controller = make_controller(plan.character, plan.reference, plan.controller)
    setup = make_character_setup(plan.character, plan.simulator)
    with Simulation([setup], make_simulation_settings(plan.simulator)) as run:
        (simulated,) = run.characters
        states = [simulated.state]
        for _ in range(plan.ticks):
            effort, _ = controller.compute_effort(states[-1], states[0].stamp_ns)
            run.step([effort], [[push for push in pushes if push.acts_at(run.tick)]])
            states.append(simulated.state)
    return states


@dataclass(frozen=True)
class Made:
    """A run with pushes over topics, and what it has left."""

    directory: Path
    recording: Recording
    summary: dict[str, Any]
    most_alive: int  # of its processes at once
    left: int  # of them, after it


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Made:
    directory, mark = tmp_path_factory.mktemp("pushed") / "run", uuid.uuid4().hex
    most_alive = run_plan(plan_of(), directory, mark, inputs=PlannedInputs(PLANNED))
    summary, _ = read_metrics(directory)
    return Made(directory, read_recording(directory), summary, most_alive, len(family(mark)))


# A run with pushes


@pytest.mark.slow
def test_each_push_acts_from_exactly_its_tick_for_the_duration(pushed: Made) -> None:
    applied = pushed.recording.applied_wrench

    found = {}
    for tick, wrenches in enumerate(applied, start=1):
        assert wrenches is not None
        rows = zip(
            wrenches.links, wrenches.wrenches.tolist(), wrenches.points.tolist(), strict=True
        )
        found[tick] = sorted((link, tuple(wrench), tuple(point)) for link, wrench, point in rows)

    expected = {
        tick: sorted(
            (link, wrench, tuple(centre_of(link).tolist()) if point is None else point)
            for first, link, wrench, point in PUSHES
            if first <= tick < first + HELD
        )
        for tick in range(1, TICKS + 1)
    }
    assert found == expected
    assert [tick for tick in found if found[tick]] == [1, 2, 3, 40, 41, 42, 43, 60]


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
def test_a_run_in_one_process_takes_the_same_pushes(pushed: Made, tmp_path: Path) -> None:
    prepare_directory(tmp_path / "run", overwrite=False)

    run_in_process(plan_of(), tmp_path / "run", inputs=PlannedInputs(PLANNED))

    summary, _ = read_metrics(tmp_path / "run")
    assert summary["state_hash"] == pushed.summary["state_hash"]


@pytest.mark.slow
def test_nothing_is_left_behind_but_what_was_planned(pushed: Made) -> None:
    assert pushed.most_alive == 4
    assert pushed.left == 0
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
    push = plan_push(plan_of(), "chest", (1.0, 2.0, 3.0), time)

    expected = PlannedPush(CLOCK.stamp_ns(tick), "chest", (1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
    assert push == expected


@pytest.mark.parametrize(
    ("link", "force", "time", "expected"),
    [
        ("chset", 1.0, 0.0, ["'chset'", "did you mean 'chest'?"]),
        ("chest", np.nan, 0.0, ["'chest'", "nan", "finite"]),
        ("chest", 1.0, -0.1, ["-0.1 s", "0.25 s"]),
        ("chest", 1.0, 0.25, ["less than 0.25 s"]),
        ("chest", 1.0, np.nan, ["nan s"]),
    ],
)
def test_a_push_that_cannot_act_is_rejected_in_a_line(
    link: str, force: float, time: float, expected: list[str]
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        plan_push(plan_of(), link, (force, 0.0, 0.0), time)

    line = str(caught.value)
    assert "\n" not in line and all(part in line for part in expected)


# Its file


EXACT = [
    *PLANNED,
    PlannedPush(2**53 + 1, "chest", (0.1, 1e-300, -1e300, 1 / 3, 0.0, -0.0), HAND),
]
A_BALL = ProjectileThrow(0.1, 1 / 3, (1e-300, -0.0, 1 / 7), (0.3, 0.0, -1.0))
BALLS = [PlannedThrow(2**53 + 1, A_BALL), PlannedThrow(1, A_BALL)]


def test_what_is_written_is_read_to_the_bit(tmp_path: Path) -> None:
    write_planned(tmp_path / "pushes.json", EXACT)
    write_planned(tmp_path / "throws.json", BALLS)

    assert_same(read_pushes(tmp_path / "pushes.json"), EXACT)
    found = read_throws(tmp_path / "throws.json")
    assert [each.stamp_ns for each in found] == [1, 2**53 + 1]
    assert found[1].throw.numbers().tobytes() == A_BALL.numbers().tobytes()


def assert_same(pushes: Sequence[PlannedPush], others: Sequence[PlannedPush]) -> None:
    in_order = sorted(others, key=lambda push: push.stamp_ns)
    for one, other in zip(pushes, in_order, strict=True):
        found, expected = one.arrays(), other.arrays()
        assert (found.stamp_ns, found.links) == (expected.stamp_ns, expected.links)
        assert found.wrenches.tobytes() == expected.wrenches.tobytes()
        assert found.points.tobytes() == expected.points.tobytes()


WRONG_FILES: list[tuple[Callable[[Path], object], str, bytes]] = [
    (read_pushes, "pushes", b"tomorrow"),
    (read_pushes, "pushes", b'{"stamp_ns": 1}'),
    (read_pushes, "pushes", b"[1, 2]"),
    (read_pushes, "pushes", b'[{"stamp_ns": 1, "link": "chest", "force": [1, 2, 3]}]'),
    (read_pushes, "pushes", b'[{"stamp_ns": 1, "link": "chest"}]'),
    (read_pushes, "pushes", b"\xff\xfe\x00"),
    (read_throws, "throws", b"tomorrow"),
    (read_throws, "throws", b"[1]"),
    (read_throws, "throws", b'[{"stamp_ns": 1, "throw": {"mass": 2.0}}]'),
]


@pytest.mark.parametrize(("read", "what", "content"), WRONG_FILES)
def test_a_file_that_holds_something_else_is_rejected_in_a_line(
    tmp_path: Path, read: Callable[[Path], object], what: str, content: bytes
) -> None:
    file = tmp_path / "planned.json"
    file.write_bytes(content)

    with pytest.raises(RecordingError) as caught:
        read(file)

    line = str(caught.value)
    assert line.startswith(f"{file} holds no {what}: ") and "\n" not in line


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


def test_by_default_all_is_sent_to_the_first_who_listens(
    processes: Processes, client: SimulatorClient, tmp_path: Path
) -> None:
    write_planned(tmp_path / "pushes.json", PLANNED)
    write_planned(tmp_path / "throws.json", BALLS)
    pushes, throws = client.listen(topics.EXTERNAL_WRENCH), client.listen(topics.THROW)

    processes.node("pusher", file="pushes.json", throws="throws.json")

    client.spin_until(lambda: len(throws) == len(BALLS), "the throws")
    client.spin_until(lambda: len(pushes) == len(PLANNED), "the pushes")
