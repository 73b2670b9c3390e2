"""The marks of a recorded run's time line: when what happened, by other ways of knowing it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.render.scene import make_scene
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.throw_hits import describe_hits, read_states
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.wrenches import parse_push
from actuated_characters.viewer.recorded.hits import find_hits
from actuated_characters.viewer.recorded.marks import Mark, find_marks
from actuated_characters.viewer.recorded.run import read_run
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.throw import ProjectileThrow
from tests.support.runs import run_plan_here

STEP_NS = NANOSECONDS_PER_SECOND // 240
EARLIER, AT = 84, 96  # ticks in which the balls begin, so that one's first state is of 0.4 s
# One falls on the ground, and rolls away from the body; one strikes the trunk hard after a metre.
ROLLS = ProjectileThrow(3.0, 0.2, (0.0, 2.0, 0.3), (0.0, 1.0, 0.0))
HITS = ProjectileThrow(6.0, 0.1, (-1.0, 0.0, 1.1), (10.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def stands(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A humanoid that stands, is pushed at 0.2 s, and has a ball thrown at it at 0.4 s."""
    directory = tmp_path_factory.mktemp("runs") / "stands"
    simulator = {"wrench_duration": 0.1, "keyframe_period": 0.25}
    controller = {"root_assistance": True, "keyframe_period": 0.25, "behaviour": "active_ragdoll"}
    plan = make_plan("humanoid", 1.0, {"reference": "hold"}, simulator, controller)
    balls = ((EARLIER, ROLLS), (AT, HITS))
    throws = [PlannedThrow((tick + 1) * STEP_NS, each) for tick, each in balls]
    pushes = [parse_push("root:0,60,0@0.2", plan)]
    run_plan_here(plan, directory, PlannedInputs(pushes, throws))
    return directory


def of_kind(marks: list[Mark], kind: str) -> list[Mark]:
    return [mark for mark in marks if mark.kind == kind]


def test_marks_say_when_something_happened(stands: Path) -> None:
    marks = find_marks(read_run(stands))

    (push,) = of_kind(marks, "push")
    assert (push.start, push.end) == pytest.approx((0.2, 0.3))
    assert push.text == "push on root for 0.1 s: up to 60 N, 6 N s"
    assert [mark.start for mark in of_kind(marks, "throw")] == pytest.approx([0.35, 0.4], abs=0.005)
    keyframes = [mark.start for mark in of_kind(marks, "keyframe")]
    assert keyframes == pytest.approx([0.5, 0.75, 1.0])  # there is none while a push acts
    (end,) = of_kind(marks, "end")
    assert end.start == pytest.approx(1.0)
    assert [mark.start for mark in marks] == sorted(mark.start for mark in marks)


def test_modes_follow_one_another_without_a_gap(stands: Path) -> None:
    modes = of_kind(find_marks(read_run(stands)), "mode")

    assert [mode.label for mode in modes[:2]] == ["TRACK", "LIMP"]
    assert (modes[0].start, modes[-1].end) == (0.0, pytest.approx(1.0))
    starts, ends = np.array([(mode.start, mode.end) for mode in modes]).T
    np.testing.assert_allclose(starts[1:], ends[:-1])
    assert all(mode.color.startswith("#") and len(mode.color) == 7 for mode in modes)


def test_a_ball_hits_when_simulating_it_without_the_character_says_so(stands: Path) -> None:
    recording = read_recording(stands)
    plan = make_plan("humanoid", 1.0, {"reference": "hold"}, {}, {})
    throws = [
        PlannedThrow(int(recording.stamps_ns[tick]), throw)
        for tick, each in enumerate(recording.throws)
        for throw in each
    ]

    words = describe_hits(plan, throws, read_states(stands))

    hits = find_hits(recording)
    assert {each.ball for each in hits} == {"ball_2"}
    hit = hits[0]
    assert words == ["missed", f"hit '{hit.link}' at {hit.time:.3f} s"]
    # it loses its speed, and at most comes back with it
    assert 0.3 * 60.0 < hit.impulse < 2.0 * 60.0


def test_a_ball_that_was_thrown_before_the_bag_began_takes_no_other_balls_throw(
    stands: Path,
) -> None:
    whole = read_recording(stands)
    (hit, *_) = find_hits(whole)
    first = AT - 6  # one ball flies
    part = whole.rows(slice(first, len(whole.stamps_ns)))
    assert part.balls[0] is not None and part.balls[0].names == ("ball_1",)

    (found, *_) = find_hits(part)

    assert (found.ball, found.link, found.impulse) == (hit.ball, hit.link, hit.impulse)
    assert found.time == pytest.approx(hit.time - first / 240.0)


def test_nothing_is_told_of_a_ball_whose_throw_is_not_in_the_bag(stands: Path) -> None:
    whole = read_recording(stands)
    part = whole.rows(slice(AT + 4, len(whole.stamps_ns)))  # both fly
    assert part.balls[0] is not None and len(part.balls[0].names) == 2

    assert find_hits(part) == []


def test_one_keyframe_is_a_place_to_choose_unless_it_is_the_first_state(tmp_path: Path) -> None:
    plan = make_plan("pendulum", 0.2, {"reference": "hold"}, {"keyframe_period": 0.15}, {})
    run_plan_here(plan, tmp_path / "short")
    run = read_run(tmp_path / "short")

    (mark,) = of_kind(find_marks(run), "keyframe")

    assert mark.start == pytest.approx(0.15)
    (recording,), row = run.recordings, round(0.15 * 240)
    part = replace(run, scene=make_scene([recording.rows(slice(row, len(run.times)))]))
    assert not of_kind(find_marks(part), "keyframe")
