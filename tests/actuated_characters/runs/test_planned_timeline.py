"""Runs of timelines: what they send and when, one hash however they run, and what is refused."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.commands.common.planned_run import PlannedRun, planned_run
from actuated_characters.commands.run import add_run
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_commands
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.planned.behaviours import read_behaviours
from actuated_characters.runs.planned.files import write_planned
from actuated_characters.runs.planned.strengths import read_strengths
from actuated_characters.runs.planned.timeline import plan_timeline
from controller_node.planner.settings import PlannerParameters, make_planner_settings
from controller_node.references.posture import Posture
from controller_node.references.timeline.file import shipped_timelines
from msgs_config.errors import ActuatedCharactersError
from msgs_config.messages.clock import TickClock
from tests.support.runs import run_plan, run_plan_here, summary_of

RATE = 240
CLOCK = TickClock(RATE)
ASSISTED = {"planner": "none"}
WAVE = {"poses": [{"at": 0.3, "pose": {"right_elbow": 1.0}}]}
EVENTFUL: dict[str, Any] = {
    "duration": 1.0,
    "run": ASSISTED,
    "keys": [WAVE],
    "clips": [{"at": 0.0, "clip": "walk"}],
    "strengths": [{"at": 0.2, "until": 0.6, "joints": ["left_elbow", "neck"], "strength": 0.3}],
    "pushes": [{"at": 0.5, "link": "chest", "force": [40, 0, 0], "for": 0.2}],
    "throws": [
        {"at": 0.6, "mass": 1, "speed": 8, "target": "chest"},
        {"at": 0.7, "mass": 9, "speed": 3, "target": "left_ankle", "shape": "box", "slide": True},
    ],
    "behaviours": [{"at": 0.3, "until": 0.55, "do": "brace"}, {"at": 0.6, "do": "react"}],
}


def planned(directory: Path, content: dict[str, Any], *options: str) -> PlannedRun:
    file = directory / "moves.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    commands = argparse.ArgumentParser().add_subparsers()
    add_run(commands)
    return planned_run(commands.choices["run"].parse_args(["--timeline", str(file), *options]))


def tick(time: float) -> int:
    return CLOCK.stamp_ns(1 + round(time * RATE))


@pytest.mark.slow
def test_the_command_says_of_each_ball_whether_it_has_hit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "moves.yaml"
    file.write_text(yaml.safe_dump(EVENTFUL), encoding="utf-8")
    throw = "mass=1 speed=8 at=0.7 target=neck"
    arguments = ["--timeline", str(file), "--throw", throw, "--output", str(tmp_path / "run")]

    assert main(["run", "--in-process", *arguments]) == 0

    said = capsys.readouterr().out
    assert "throws 1: " in said and f"throw '{throw}': " in said


@pytest.mark.slow
def test_over_topics_in_one_process_and_from_its_bag_a_run_has_one_hash(tmp_path: Path) -> None:
    run = planned(tmp_path, EVENTFUL)
    alone, sent = tmp_path / "alone", tmp_path / "sent"

    run_plan_here(run.plan, alone, run.inputs)
    run_plan(run.plan, sent, inputs=run.inputs)

    assert summary_of(alone)["state_hash"] == summary_of(sent)["state_hash"]
    assert replay([read_recording(sent)]).identical
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("ROS_DOMAIN_ID", raising=False)
        again = replay_commands(sent, progress=lambda _: None, tell=lambda _: None)
    assert again.identical and again.states == RATE + 1
    *_, last = ticks_in_process(
        run.plan,
        run.inputs.pushes,
        run.inputs.throws,
        strengths=run.inputs.strengths,
        behaviours=run.inputs.behaviours,
    )
    ends = read_recording(sent).position[-1]
    np.testing.assert_array_equal(last.following.position, ends)
    recording = read_recording(alone)
    pushed = [row for row, push in enumerate(recording.applied_wrench) if push and push.links]
    assert pushed == list(range(120, 168))  # 0.2 s, though a push is held for 0.1 s
    elbow = recording.layout.dof_names.index("left_elbow")
    weak = recording.effort[60:140, elbow]
    assert np.abs(weak).max() <= 0.3 * 60.0 + 1e-9  # of the file's limit, N m


def test_without_a_word_a_character_is_planned_for_and_what_is_said_counts(tmp_path: Path) -> None:
    def planner(content: dict[str, Any], *options: str) -> str:
        return PlannerParameters.of(planned(tmp_path, content, *options).plan.controller).planner

    assert planner({}) == "predictive"
    assert planner({"run": ASSISTED}) == "none"
    assert planner({"run": ASSISTED}, "--planner", "predictive") == "predictive"
    arm = {"character": "franka_panda"}
    assert planner(arm) == "none"
    given = planned(tmp_path, {**arm, "set": {"sim_node.rate": 500}})
    assert given.plan.character.name == "franka_panda"
    assert given.plan.simulation.rate_hz == 500
    other = planned(tmp_path, {"run": ASSISTED}, "--set", "sim_node.friction:=0.5")
    assert other.plan.simulator["friction"] == 0.5


def test_only_what_may_not_fall_is_planned_in_longer_steps(tmp_path: Path) -> None:
    def step(content: dict[str, Any], *options: str) -> int:
        plan = planned(tmp_path, content, *options).plan
        return make_planner_settings(plan.character, plan.controller).step

    assert step({}) == 2  # ticks
    assert step({"run": {"behaviour": "active_ragdoll"}}) == 1
    assert step({"behaviours": [{"at": 1.0, "do": "brace"}]}) == 1
    assert step({}, "--behaviour", "reactive") == 1
    assert step({"set": {"controller_node.plan.step": 0}}) == 1
    assert step({}, "--set", "controller_node.plan.step:=0.05") == 12  # all of a period


def test_it_lasts_until_all_is_over(tmp_path: Path) -> None:
    content = {"run": ASSISTED, "limp": [{"at": 1.0, "until": 2.0}], "keys": [WAVE]}

    assert planned(tmp_path, content).plan.ticks == 3 * RATE
    assert planned(tmp_path, {**content, "duration": 5}).plan.ticks == 5 * RATE
    assert planned(tmp_path, content, "--duration", "4").plan.ticks == 4 * RATE


def test_after_steering_it_lasts_until_the_character_stands(tmp_path: Path) -> None:
    steering = [{"at": 0.5, "until": 2.0, "velocity": [0.8, 0.0, 0.0]}]

    plan = planned(tmp_path, {"run": ASSISTED, "steering": steering}).plan

    seconds = plan.ticks / RATE
    last = [plan.reference.sample(seconds - ago).configuration.position for ago in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(last[1:], last[:1] * 2, atol=2e-3)
    assert 2.0 < seconds < 6.0


def test_strengths_that_overlap_multiply_and_are_written_and_read(tmp_path: Path) -> None:
    content = {
        "run": ASSISTED,
        "limp": [{"at": 3.0, "until": 4.0}],
        "strengths": [
            {"at": 1.0, "until": 2.0, "joints": ["neck", "chest"], "strength": 0.5},
            {"at": 1.5, "until": 3.5, "joints": ["neck"], "strength": 0.5},
        ],
    }

    run = planned(tmp_path, content)

    sent = {each.stamp_ns: each.strengths for each in run.inputs.strengths}
    joints = run.plan.character.layout.actuated_joint_names
    assert sent == {
        tick(1.0): {"neck": 0.5, "chest": 0.5},
        tick(1.5): {"neck": 0.25, "chest": 0.5},
        tick(2.0): {"neck": 0.5},
        tick(3.0): dict.fromkeys(joints, 0.0),
        tick(3.5): dict.fromkeys(joints, 0.0),
        tick(4.0): {},
    }
    write_planned(tmp_path / "strengths.json", run.inputs.strengths)
    assert read_strengths(tmp_path / "strengths.json") == list(run.inputs.strengths)


def test_between_behaviours_it_does_what_the_run_says_or_tracks(tmp_path: Path) -> None:
    def asked(content: dict[str, Any], *options: str) -> tuple[object, list[tuple[int, str]]]:
        run = planned(tmp_path, {"behaviours": behaviours, **content}, *options)
        sent = [(each.stamp_ns, each.ask) for each in run.inputs.behaviours]
        write_planned(tmp_path / "behaviours.json", run.inputs.behaviours)
        assert read_behaviours(tmp_path / "behaviours.json") == list(run.inputs.behaviours)
        return run.plan.controller["behaviour"], sent

    behaviours = [
        {"at": 3.0, "do": "get_up"},
        {"at": 1.0, "until": 2.0, "do": "react"},
        {"at": 2.0, "until": 2.5, "do": "brace"},
    ]
    times = [(tick(1.0), "react"), (tick(2.0), "brace"), (tick(3.0), "get_up")]
    last = times.pop()

    tracks = [(tick(0.0), "track"), *times, (tick(2.5), "track"), last]
    assert asked({"run": ASSISTED}) == ("active_ragdoll", tracks)
    reacts = [*times, (tick(2.5), "react"), last]
    assert asked({"run": {**ASSISTED, "behaviour": "reactive"}}) == ("reactive", reacts)
    assert asked({"run": ASSISTED}, "--behaviour", "reactive") == ("reactive", reacts)
    assert planned(tmp_path, {"behaviours": behaviours}).plan.ticks == 4 * RATE


def test_pushes_and_balls_of_the_options_come_besides(tmp_path: Path) -> None:
    throw = "mass=1 speed=8 at=0.7 target=neck"

    run = planned(tmp_path, EVENTFUL, "--push", "chest:1,0,0@0.1", "--throw", throw)

    assert [each.stamp_ns for each in run.inputs.pushes] == [tick(0.5), tick(0.6), tick(0.1)]
    assert len(run.inputs.throws) == 3


def test_what_is_limp_has_no_effort_until_it_is_over(tmp_path: Path) -> None:
    content = {"run": ASSISTED, "duration": 1.0, "limp": [{"at": 0.25, "until": 0.75}]}
    run = planned(tmp_path, content)

    run_plan_here(run.plan, tmp_path / "run", run.inputs)

    effort = read_recording(tmp_path / "run").effort[:, 6:]
    moved = np.abs(effort).max(axis=1) > 0.0
    assert moved[:60].all() and not moved[60:180].any() and moved[180:].all()


# The timelines that come with the package


@pytest.mark.parametrize("name", shipped_timelines())
def test_a_shipped_timeline_can_be_run_as_it_is(name: str) -> None:
    run = plan_timeline(name, {}, {})

    assert run.warnings == []
    controller = run.plan.controller  # by joint torques alone: planned, or without a root force
    planner = PlannerParameters.of(controller).planner
    assert planner == "predictive" or not controller["root_assistance"]
    assert run.reference.end <= run.plan.ticks / RATE


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", shipped_timelines())
def test_a_shipped_timeline_comes_to_its_end_by_joint_torques_alone(name: str, seed: int) -> None:
    run = plan_timeline(name, {}, {"plan.seed": seed})
    layout = run.plan.character.layout

    ticks = list(
        ticks_in_process(
            run.plan,
            run.inputs.pushes,
            run.inputs.throws,
            strengths=run.inputs.strengths,
            pins=run.inputs.pins,
            behaviours=run.inputs.behaviours,
        )
    )

    effort = np.array([tick.following.effort for tick in ticks])
    assert not effort[:, :6].any()
    last = layout.configuration(ticks[-1].following.position)
    wanted = run.reference.sample(len(ticks) / RATE).configuration
    assert not Posture(run.plan.character).has_fallen(last, wanted)
    assert last.position[2] > 0.7
    if name == "stumble":  # over the box
        lowest = min(tick.following.position[2] for tick in ticks)
        assert lowest < 0.3


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (
            {"pushes": [{"at": 0.1, "link": "chest", "force": [1, 0, 0], "for": 0.15}]},
            "pushes 1: for is 0.15 s; it must be a multiple of 0.1 s, the parameter sim_node.wr",
        ),
        ({"pushes": [{"at": 9, "link": "chest", "force": [1, 0, 0]}]}, "pushes 1: .*time is 9"),
        ({"pushes": [{"at": 0, "link": "ear", "force": [1, 0, 0]}]}, "pushes 1: .*'ear'"),
        ({"throws": [{"at": 0.5, "mass": 1, "target": "chest"}]}, "throws 1: 'speed' is missing"),
        (
            {"strengths": [{"at": 0, "until": 1, "joints": ["ear"], "strength": 1}]},
            "strengths 1: .*'ear'",
        ),
        ({"behaviours": [{"at": 0, "do": "brase"}]}, "behaviours 1: .*'brase'.*brace"),
        ({"behaviours": [{"at": 5, "do": "brace"}]}, "behaviours 1: at is 5 s; the run ends"),
        (
            {
                "behaviours": [{"at": 0, "do": "react"}],
                "run": {**ASSISTED, "behaviour": "tracking"},
            },
            "behaviours 1: the run's behaviour is tracking.* must be active_ragdoll or reactive",
        ),
        (
            {"behaviours": [{"at": 0, "until": 0.5, "do": "react"}, {"at": 0.3, "do": "brace"}]},
            "behaviours 2: at is 0.3; it must be 0.5 s or later",
        ),
        ({"limp": [{"at": 5, "until": 6}]}, "limp 1: at is 5 s; the run ends at 1 s"),
        ({"set": {"controller_node.lwa": 1}}, "lwa"),
        ({"run": {"planner": "magic"}}, "magic"),
    ],
)
def test_what_cannot_be_sent_is_refused_in_a_line(
    tmp_path: Path, content: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ActuatedCharactersError, match=sentence) as caught:
        planned(tmp_path, {"duration": 1, "run": ASSISTED, **content})

    assert "\n" not in str(caught.value)
