"""Feedforward against feedback: the torques of a run played again, left alone and pushed."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from actuated_characters.render.plots import label
from actuated_characters.render.stills import pose_strip
from controller_node.effort_series import write_effort_series
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import (
    WALK,
    RunResult,
    RunSpec,
    StudyRunner,
    plan_push,
)
from lecture.framework.tracking import joint_errors

TITLE = "torques of a run, played again (open loop) and computed again (closed loop)"
RUNS = 8

_RATE = 240  # Hz
_PUSH_TIME, _PUSH_DURATION, _IMPULSE = 1.0, 0.1, 0.5  # s, s, N s
_LAST_SECONDS = 0.5  # s, at the end of a run
_STRIP_TIMES = (0.9, 1.2, 1.5, 1.8, 2.1, 3.0)  # s
_TILE = (240, 260)  # pixels of a picture in the strip
_LEAST_ERROR = 1e-5  # rad; a smaller error is shown as this one
_DURATION = 4.0  # s
_SIMULATOR = {"rate": _RATE, "wrench_duration": _PUSH_DURATION}
_SINE = {"reference": "sine", "sine.amplitude": 0.3, "sine.frequency": 0.5}
_ARM_LAW, _WALK_LAW = {"law": "computed_torque"}, {"law": "stable_pd"}
_CLOSED_LOOPS = {  # loops, by the link that is pushed
    "lbr_iiwa_link_7": RunSpec("kuka-closed", "kuka", _DURATION, _SINE, _SIMULATOR, _ARM_LAW),
    "chest": RunSpec("humanoid-closed", "humanoid", _DURATION, WALK, _SIMULATOR, _WALK_LAW),
}
# Styles by loop, and by whether it is pushed.
_STYLES: Mapping[tuple[str, bool], dict[str, Any]] = {
    ("closed", False): {"color": "tab:blue", "linewidth": 5.0, "alpha": 0.35},
    ("open", False): {"color": "black", "linestyle": ":", "linewidth": 1.5},
    ("closed", True): {"color": "tab:blue", "linewidth": 1.2},
    ("open", True): {"color": "tab:orange", "linewidth": 1.5},
}


_Quartet = Mapping[tuple[str, bool], RunResult]
"""The runs of closed and open loop, left alone and pushed, in the order of `_STYLES`."""


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Four runs of an arm and of a walk."""
    quartets = {
        case.character: _run_loops(runner, case, link) for link, case in _CLOSED_LOOPS.items()
    }
    for character, quartet in quartets.items():
        result.rows += [_row(character, *key, quartet) for key in quartet]
        curves = {"time_s": quartet["closed", False].recording.times[:-1]}
        for (loop, pushed), outcome in quartet.items():
            name = f"{loop}{'_pushed' if pushed else ''}_rad"
            curves[name] = joint_errors(outcome.recording).mean(axis=1)
        result.add_curves(f"feedforward_{character}", curves)
    _draw_errors(result, list(quartets.values()))
    _draw_poses(result, quartets["humanoid"])
    same = all(row["same states"] for row in result.rows if not row["push (N s)"])
    result.remarks += [
        "Left alone, the torques played again give "
        + ("the same motion, to the last bit." if same else "another motion, which is a fault."),
        f"A push of {_IMPULSE:g} N s is enough for the arm to drift away in open loop, "
        f"and one of {_IMPULSE:g} N s for the walk to fall; with feedback both go on.",
        "Feedforward supposes that the system is as foreseen; feedback is for what is not.",
    ]


def _run_loops(runner: StudyRunner, closed: RunSpec, link: str) -> _Quartet:
    first = runner.run(closed)
    recording, character = first.recording, closed.character
    file = runner.path(f"{character}_efforts.csv")
    write_effort_series(file, recording.layout, recording.times[:-1], recording.effort)
    controller = {"law": "feedforward", "feedforward": str(file)}
    opened = replace(closed, label=f"{character}-open", controller=controller)
    outcomes = [first, runner.run(opened)]
    push = plan_push(_PUSH_TIME, _RATE, link, (0.0, _IMPULSE / _PUSH_DURATION, 0.0))
    for case in (closed, opened):
        outcomes.append(runner.run(replace(case, label=f"{case.label}-pushed", pushes=[push])))
    return dict(zip(_STYLES, outcomes, strict=True))


def _row(character: str, loop: str, pushed: bool, quartet: _Quartet) -> Row:
    outcome, closed = quartet[loop, pushed], quartet["closed", False].recording
    run = outcome.recording
    times, error = run.times[:-1], joint_errors(run).mean(axis=1)
    before, last = times <= _PUSH_TIME, times > times[-1] - _LAST_SECONDS
    return {
        "character": character,
        "loop": loop,
        "push (N s)": _IMPULSE if pushed else 0.0,
        "same states": (
            run.position.tobytes() == closed.position.tobytes()
            and run.velocity.tobytes() == closed.velocity.tobytes()
        ),
        "mean joint error before the push (rad)": float(error[before].mean()),
        "largest afterwards (rad)": float(error[~before].max()),
        "in the last 0.5 s (rad)": float(error[last].mean()),
        "fell": outcome.measured("fell"),
    }


def _draw_errors(result: StudyResult, quartets: Sequence[_Quartet]) -> None:
    panels = result.add_panels("feedforward_error", 1, 2, (11.0, 4.4))
    titles = ("arm (kuka): sine of 0.3 rad", "walk of the humanoid, with root assistance")
    end = _PUSH_TIME + _PUSH_DURATION
    for axes, quartet, title in zip(panels, quartets, titles, strict=True):
        for (loop, pushed), outcome in quartet.items():
            run, name = outcome.recording, f"{loop} loop, {'pushed' if pushed else 'left alone'}"
            error = np.maximum(joint_errors(run).mean(axis=1), _LEAST_ERROR)
            axes.semilogy(run.times[:-1], error, label=name, **_STYLES[loop, pushed])
        axes.axvspan(_PUSH_TIME, end, color="tab:red", alpha=0.3, label="push")
        label(axes, "time (s)", "mean joint error (rad)", f"{title}; {_IMPULSE:g} N s")


def _draw_poses(result: StudyResult, walk: _Quartet) -> None:
    poses, captions = [], []
    for loop in ("closed", "open"):
        run = walk[loop, True].recording
        rows = np.searchsorted(run.times, _STRIP_TIMES).clip(max=len(run.times) - 1)
        poses.append(run.position[rows])
        captions += [f"{loop}, {time:.1f} s" for time in _STRIP_TIMES]
    columns, together = len(_STRIP_TIMES), np.concatenate(poses)
    picture = pose_strip(run.character, together, captions, columns=columns, size=_TILE)
    title = (
        f"pushed by {_IMPULSE:g} N s at {_PUSH_TIME:g} s; above: closed loop, "
        "below: the torques played again as if nothing had happened"
    )
    result.add_pictures(
        "feedforward_walk", {title: picture}, width=11.0, title_height=0.4, title_place="center"
    )
