"""A run in one process: its bag is that of a run over topics but for wall times."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from actuated_characters.bags.recording import read_recording
from actuated_characters.commands.common.planned_run import PlannedRun
from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
from actuated_characters.replay.replay import replay
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.inputs import NO_INPUTS, PlannedInputs
from actuated_characters.runs.planned.throws import plan_throws
from actuated_characters.runs.planned.velocities import plan_velocities
from actuated_characters.runs.planned.wrenches import PlannedPush, parse_push
from msgs_config.errors import ConfigurationError, RunError, SimulationError
from msgs_config.messages.clock import TickClock
from tests.support.recorded_nodes import PAIR, record_pair, record_pair_in_process
from tests.support.ros import Processes
from tests.support.runs import Run, run_plan, summary_of
from tests.support.same_messages import assert_same_messages, messages_by_topic

WALK = {"reference": "clip", "clip": "walk"}
BALL = "mass=3 speed=8 at=0.3 target=chest"


def pushed_walk() -> PlannedRun:
    plan = make_plan("humanoid", 0.5, WALK, {}, {})
    return PlannedRun(plan, PlannedInputs([parse_push("chest:150,0,0@0.2", plan)]), ())


def reactive_pushed_with_a_ball() -> PlannedRun:
    plan = make_plan("humanoid", 0.8, WALK, {}, {"behaviour": "reactive"})
    throws, _ = plan_throws(plan, [BALL])
    return PlannedRun(plan, PlannedInputs([parse_push("chest:150,0,0@0.2", plan)], throws), ())


def steered_machine() -> PlannedRun:
    plan = make_plan("humanoid", 0.8, {}, {}, {"behaviour": "state_machine", "machine": "walk"})
    plan, velocities = plan_velocities(plan, "0.8,0,0.2@0.1")
    return PlannedRun(plan, PlannedInputs(velocities=velocities), ())


def planned_backflip() -> PlannedRun:
    quickly = {"planner": "predictive", "plan.samples": 8, "plan.rounds": 1}
    plan = make_plan("humanoid", 0.3, {"reference": "clip", "clip": "backflip"}, {}, quickly)
    return PlannedRun(plan, NO_INPUTS, ())


def in_process(run: PlannedRun, directory: Path) -> Path:
    """The directory of a run in this process."""
    prepare_directory(directory, overwrite=False)
    run_in_process(
        run.plan,
        directory,
        recording=recording_of(run.plan),
        inputs=run.inputs,
    )
    return directory


def recording_of(plan: RunPlan) -> dict[str, object]:
    return {"sensors": [sensor.topic for sensor in plan.character.sensors]}


@pytest.mark.slow
@pytest.mark.parametrize(
    "run",
    [
        reactive_pushed_with_a_ball,
        *(
            pytest.param(each, marks=pytest.mark.nightly)
            for each in (steered_machine, planned_backflip)
        ),
    ],
)
def test_the_messages_are_those_of_a_run_over_topics(
    run: Callable[[], PlannedRun], tmp_path: Path
) -> None:
    planned = run()
    alone = in_process(planned, tmp_path / "alone")
    run_plan(
        planned.plan,
        tmp_path / "sent",
        recording=recording_of(planned.plan),
        inputs=planned.inputs,
    )

    assert_same_messages(alone / "bag", tmp_path / "sent" / "bag")
    summaries = [summary_of(directory) for directory in (alone, tmp_path / "sent")]
    for summary in summaries:
        assert summary.pop("wall_time_s") > 0.0
        assert summary.pop("real_time_factor") > 0.0
    assert summaries[0] == summaries[1]


@pytest.mark.slow
def test_two_characters_send_what_they_send_over_topics(domain: int, tmp_path: Path) -> None:
    del domain  # the nodes inherit it
    alone, sent = record_pair_in_process(tmp_path), record_pair(tmp_path)

    assert_same_messages(alone / "bag", sent / "bag")
    for name in PAIR:
        assert (alone / name / "summary.json").is_file()


def test_its_bag_is_replayed_to_the_bit(tmp_path: Path) -> None:
    run = pushed_walk()

    recording = read_recording(in_process(run, tmp_path / "run"))

    assert len(recording.effort) == run.plan.ticks
    assert replay([recording]).identical
    assert recording.applied_wrench is not None and any(
        each.links for each in recording.applied_wrench
    )


def test_without_a_bag_it_has_the_same_figures(tmp_path: Path) -> None:
    plan = make_plan("pendulum", 0.2, {}, {}, {})
    for name, write_bag in (("with", True), ("without", False)):
        prepare_directory(tmp_path / name, overwrite=False)
        run_in_process(plan, tmp_path / name, write_bag=write_bag)

    hashes = [read_metrics(tmp_path / name)[0]["state_hash"] for name in ("with", "without")]
    assert hashes[0] == hashes[1]
    assert (tmp_path / "with" / "bag").exists() and not (tmp_path / "without" / "bag").exists()


def test_its_parameter_files_are_those_of_a_run_over_topics(tmp_path: Path) -> None:
    directory = in_process(pushed_walk(), tmp_path / "run")

    for name in ("sim_node", "controller_node"):
        file = yaml.safe_load((directory / "parameters" / f"{name}.yaml").read_text())
        parameters = file[name]["ros__parameters"]
        assert parameters["session"] == "" and parameters["wait_for_subscribers"] < 2


def test_a_simulator_that_would_pause_for_good_is_refused(tmp_path: Path) -> None:
    plan = make_plan("pendulum", 0.1, {}, {"on_fault": "pause"}, {})
    prepare_directory(tmp_path / "run", overwrite=False)

    with pytest.raises(ConfigurationError, match="'on_fault' is pause"):
        run_in_process(plan, tmp_path / "run")


def test_a_signal_whose_handler_raises_nothing_ends_it_all_the_same(tmp_path: Path) -> None:
    plan = make_plan("pendulum", 600.0, {}, {}, {})
    prepare_directory(tmp_path / "run", overwrite=False)
    before = signal.signal(signal.SIGINT, lambda number, frame: None)

    def interrupt(ticks: int) -> None:
        if ticks > 10:
            os.kill(os.getpid(), signal.SIGINT)

    try:
        with pytest.raises(RunError, match="interrupted by a signal"):
            run_in_process(plan, tmp_path / "run", progress=interrupt)
    finally:
        signal.signal(signal.SIGINT, before)

    assert len(read_recording(tmp_path / "run").effort) >= 10  # the first state is of tick 1


def test_real_time_is_the_walls(tmp_path: Path) -> None:
    plan, walls = make_plan("pendulum", 0.3, {}, {"real_time_factor": 1.0}, {}), []
    for attempt in ("first", "second", "third"):  # others may hold a run up, but not every one
        prepare_directory(tmp_path / attempt, overwrite=False)
        run_in_process(plan, tmp_path / attempt)
        walls.append(read_metrics(tmp_path / attempt)[0]["wall_time_s"])

    assert min(walls) == pytest.approx(0.3, abs=0.1)


def test_an_input_that_the_simulator_rejects_is_said(tmp_path: Path) -> None:
    plan = make_plan("pendulum", 0.1, {}, {}, {})
    prepare_directory(tmp_path / "run", overwrite=False)
    beyond = PlannedPush(TickClock(240).stamp_ns(5), "tail", (1.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    with pytest.raises(RunError, match="sim_node rejected 1 of 1 pushes"):
        run_in_process(plan, tmp_path / "run", inputs=PlannedInputs([beyond]))

    assert "push refused: " in (tmp_path / "run" / "logs" / "sim_node.log").read_text()


def test_what_went_wrong_has_the_name_of_its_node_and_the_bag_what_came_before(
    tmp_path: Path,
) -> None:
    gains = {"gains.hinge.p": 1e9, "gains.hinge.d": 0.0, "law": "pd", "effort_limit.hinge": 1e6}
    plan = make_plan("pendulum", 1.0, {"reference": "sine"}, {"speed_limit": 5.0}, gains)
    prepare_directory(tmp_path / "run", overwrite=False)

    with pytest.raises(SimulationError, match=r"^sim_node: "):
        run_in_process(plan, tmp_path / "run")

    assert messages_by_topic(tmp_path / "run" / "bag")["/joint_states"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_a_whole_bag(
    processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    directory = tmp_path / "run"
    run = Run(
        processes, "run", "--duration", "600", "--in-process", "--output", str(directory)
    ).wait_for_ticks(directory)

    os.kill(run.process.pid, number)

    assert run.process.wait(10.0) == 130
    assert "Traceback" not in run.process.stderr
    assert len(messages_by_topic(directory / "bag")["/joint_states"]) > 10
