"""Athletes by state machine: their states, speed and heading, and the pushes that they survive."""

from collections.abc import Mapping

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.recording_metrics import has_fallen
from actuated_characters.report.events import mode_events
from lecture.athletics.drawing import (
    draw_courses,
    draw_jump,
    draw_poses,
    draw_pushes,
)
from lecture.athletics.measures import (
    CourseSeries,
    commanded,
    longest_flight,
    taken,
)
from lecture.athletics.pushes import PushMap, push_map
from lecture.framework.result import StudyResult
from lecture.framework.study import RunSpec, StudyRunner

TITLE = "athletes by state machine, by joint torques alone; walk beside the planner"
RUNS = 20

_COMMANDS = "0.5,0,0@0.5 0.9,0,0@3 0.9,0,0.4@5 0,0,0@8"
_LENGTH = 11.0  # s
_JUMP_LENGTH = 4.5
_RUN_COMMANDS, _RUN_LENGTH = "1,0,0@0.5 2,0,0@3 2,0,0.3@8 0,0,0@11", 16.0
_RUN_POSES = tuple(7.5 + 0.06 * number for number in range(12))  # s
_COMPARED_SINCE = 2.0  # s, from which on speeds are compared
_WALKS: Mapping[str, Mapping[str, object]] = {
    "walk": {"behaviour": "state_machine", "machine": "walk"},
    "planner": {"planner": "predictive"},
}
_PUSH_COMMANDS, _PUSH_TIME, _PUSH_END = "0.6,0,0@0.2", 3.0, 6.5
_USUAL_RUNS, _FINE_RUNS = (4, 4), (12, 6)  # directions, and runs for each direction


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Steer walks by a machine and by the planner, run, jump, and push the walking machine."""
    walks = {name: _steered(name) for name in _WALKS}
    runs = {name: runner.run(case).recording for name, case in walks.items()}
    wanted = commanded(walks["walk"])
    jump = runner.run(_case("jump", _JUMP_LENGTH, _machine("jump")))
    for name, recording in runs.items():
        result.rows.append(_row(name, recording, wanted))
    _run(runner, result)
    result.rows.append(_row("jump", jump.recording, None))
    title = "the same commands: the machine `walk`, and the planner that follows warped clips"
    draw_courses(result, result.name, title, runs, wanted)
    draw_jump(result, jump.recording)
    directions, halvings = _FINE_RUNS if runner.fine else _USUAL_RUNS
    names = list(walks) if runner.fine else ["walk"]
    maps = {name: _pushed(runner, name, directions, halvings) for name in names}
    draw_pushes(result, maps)
    result.remarks.append(
        "pushes: 0.2 s at the root, while it walks at 0.6 m/s; finer, and the planner's, by --fine"
    )


def _machine(name: str) -> dict[str, object]:
    return {"behaviour": "state_machine", "machine": name}


def _run(runner: StudyRunner, result: StudyResult) -> None:
    """From standing over a walk to a run, around a bend, and to a stand."""
    case = _case("run", _RUN_LENGTH, _machine("run"), _RUN_COMMANDS)
    recording, wanted = runner.run(case).recording, commanded(case)
    result.rows.append(_row("run", recording, wanted))
    title = "the machine `run`: it walks up to 1.2 m/s, and runs from there on"
    draw_courses(result, f"{result.name}_run", title, {"run": recording}, wanted)
    draw_poses(result, "run", recording, _RUN_POSES)


def _case(
    label_: str, length: float, controller: Mapping[str, object], commands: str = ""
) -> RunSpec:
    return RunSpec(
        label_,
        "humanoid",
        length,
        reference={"reference": "steered"},
        controller=controller,
        commands=commands,
        contacts=True,
    )


def _steered(name: str) -> RunSpec:
    return _case(name, _LENGTH, _WALKS[name], _COMMANDS)


def _row(name: str, run_: Recording, wanted: CourseSeries | None) -> dict[str, object]:
    speed = heading = None
    if wanted is not None:
        course = taken(run_)
        settled = slice(int(np.searchsorted(run_.times, _COMPARED_SINCE)), None)
        rows = slice(settled.start, len(run_.times))
        speed = float(np.abs(course.speed[rows] - wanted.speed[rows]).mean())
        heading = float(np.abs(course.heading[rows] - wanted.heading[rows]).mean())
    return {
        "athlete": name,
        "fell": has_fallen(run_),
        "speed error (m/s)": speed,
        "heading error (rad)": heading,
        "longest flight (s)": longest_flight(run_)[1],
        "states": len({span.facts.get("state") for span in mode_events(run_)} - {None}),
    }


def _pushed(runner: StudyRunner, name: str, directions: int, halvings: int) -> PushMap:
    case = _case(f"{name}_pushed", _PUSH_END, _WALKS[name], _PUSH_COMMANDS)
    return push_map(runner, case, _PUSH_TIME, directions, halvings, has_fallen)
