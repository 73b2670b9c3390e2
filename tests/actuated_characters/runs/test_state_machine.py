"""A state machine over topics: the states of one process, its states on ~/mode, replayed."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_states
from actuated_characters.report.events import mode_events
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.velocities import PlannedVelocity, plan_velocities
from actuated_characters.runs.planned.wrenches import parse_push
from lecture.athletics.measures import longest_flight
from msgs_config.messages import topics
from tests.support.ros import Processes, SimulatorClient, tick_of
from tests.support.runs import Run, run_plan, run_plan_here, summary_of

COMMANDS = "0.5,0,0.3@0.1 0,0,0@1.3"


def planned() -> tuple[RunPlan, list[PlannedVelocity]]:
    plan = make_plan("humanoid", 2.0, {}, {}, {"behaviour": "state_machine", "machine": "walk"})
    return plan_velocities(plan, COMMANDS)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_run_is_replayed_to_the_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan, velocities = planned()
    push = parse_push("root:60,0,0@1.1", plan)

    run_plan_here(plan, tmp_path / "run", PlannedInputs([push], velocities=velocities))

    recording = read_recording(tmp_path / "run")
    assert recording.position[-1, 0] - recording.position[0, 0] > 0.2
    labels = [span.label for span in mode_events(recording)]
    assert labels[:4] == ["stand, right", "shift, right", "step, right", "step, left"]
    assert replay([recording]).identical
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    again = replay_states(tmp_path / "run", progress=lambda _: None, tell=lambda _: None)
    assert again.identical and again.states == 481


@pytest.mark.nightly
def test_a_jump_over_topics_is_the_one_in_one_process_and_flies_by_its_recorded_contacts(
    tmp_path: Path,
) -> None:
    plan = make_plan("humanoid", 3.0, {}, {}, {"behaviour": "state_machine", "machine": "jump"})
    push = parse_push("root:20,-10,0@1.4", plan)
    alone, sent = tmp_path / "alone", tmp_path / "sent"
    prepare_directory(alone, overwrite=False)
    run_in_process(plan, alone, inputs=PlannedInputs([push]))

    run_plan(plan, sent, inputs=PlannedInputs([push]), recording={"exclude": []})

    assert summary_of(sent)["state_hash"] == summary_of(alone)["state_hash"]
    recording = read_recording(sent)
    start, flight = longest_flight(recording)
    assert 1.6 < start < 1.9 and flight >= 0.25
    labels = [span.facts["state"] for span in mode_events(recording)]
    assert labels == ["stand", "crouch", "thrust", "flight", "land", "rest"]
    assert not np.nan_to_num(recording.effort)[:, :6].any()
    assert replay([recording]).identical


@pytest.mark.slow
def test_the_command_says_what_is_wrong_with_a_machine(processes: Processes) -> None:
    run = Run(processes, "run", "--machine", "wlak", "--duration", "1")

    run.process.wait(60.0)
    assert "unknown machine 'wlak'; did you mean 'walk'?" in run.error


@pytest.mark.slow
def test_a_plain_script_drives_it_over_cmd_vel(
    processes: Processes, client: SimulatorClient
) -> None:
    example = Path(__file__).parents[3] / "examples" / "drive.py"
    processes.python(str(example))
    client.spin_until(lambda: client.node.count_publishers("cmd_vel"), "the driver")
    processes.controller("humanoid", behaviour="state_machine", reference="steered")
    velocities = client.listen(topics.ACTIVE_CMD_VEL.of(topics.CONTROLLER_NODE))
    processes.simulator("humanoid", max_ticks=5000, contact_breaking_threshold=0.1)

    # how soon who is heard is a matter of the machine; until the driver is the character stands
    client.spin_until(lambda: len(velocities) > 0, "a velocity that the controller has taken", 60.0)
    after = tick_of(velocities.messages[0]) + 720  # a slow listener may see none but later ones
    states = client.states
    client.spin_until(lambda: len(states) and tick_of(states.last) > after, "3 s", 120.0)

    state = next(each for each in states.messages if tick_of(each) > after)
    place = dict(zip(state.name, state.position, strict=True))
    assert place["root_z"] > 0.7
    # 0.8 m/s in a circle of 1.6 m to the left: more than an eighth of it, after the first step
    assert place["root_x"] > 0.8 and place["root_y"] > 0.4
