"""Feedforward against feedback: the torques of a run played again, left alone and pushed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.stills import pose_strip
from actuated_characters.studies.framework.plots import label
from actuated_characters.studies.framework.result import Row, StudyResult
from actuated_characters.studies.framework.study import (
    WALK,
    RunResult,
    RunSpec,
    StudyRunner,
    plan_push,
)
from actuated_characters.studies.framework.tracking import mean_joint_errors
from controller_node.effort_series import write_effort_series
from msgs_config.character.model import Vector

TITLE = "torques of a run, played again (open loop) and computed again (closed loop)"
RUNS = 8

_RATE = 240  # Hz
_PUSH_TIME, _PUSH_DURATION = 1.0, 0.1  # s
_LAST = 0.5  # s, at the end of a run
_STRIP_TIMES = (0.9, 1.2, 1.5, 1.8, 2.1, 3.0)  # s
_TILE = (240, 260)  # pixels of a picture in the strip
_LEAST_ERROR = 1e-5  # rad; what is shown of less
_STYLES: Mapping[tuple[str, bool], dict[str, Any]] = {  # of the loops, left alone and pushed
    ("closed", False): {"color": "tab:blue", "linewidth": 5.0, "alpha": 0.35},
    ("open", False): {"color": "black", "linestyle": ":", "linewidth": 1.5},
    ("closed", True): {"color": "tab:blue", "linewidth": 1.2},
    ("open", True): {"color": "tab:orange", "linewidth": 1.5},
}


@dataclass(frozen=True)
class _Subject:
    """What moves, and what pushes it."""

    character: str
    link: str
    force: Vector  # N
    reference: Mapping[str, object]
    controller: Mapping[str, object] = field(default_factory=dict)
    duration: float = 4.0  # s

    @property
    def impulse(self) -> float:
        """That of the push, N s."""
        return float(np.linalg.norm(self.force)) * _PUSH_DURATION


_SUBJECTS = (
    _Subject(
        character="kuka",
        link="lbr_iiwa_link_7",
        force=(0.0, 5.0, 0.0),
        reference={"reference": "sine", "sine.amplitude": 0.3, "sine.frequency": 0.5},
        controller={"law": "computed_torque"},
    ),
    _Subject(
        character="humanoid",
        link="chest",
        force=(0.0, 5.0, 0.0),
        reference=WALK,
        controller={"law": "stable_pd"},
    ),
)


@dataclass(frozen=True)
class _Loop:
    """One of the four runs of a subject: closed or open loop, left alone or pushed."""

    subject: _Subject
    loop: str  # "closed" or "open"
    pushed: bool
    outcome: RunResult
    closed: Recording  # the closed loop left alone

    @property
    def same_states(self) -> bool:
        """Whether it went through the states of the closed loop left alone, to the last bit."""
        run = self.outcome.recording
        return (
            run.position.tobytes() == self.closed.position.tobytes()
            and run.velocity.tobytes() == self.closed.velocity.tobytes()
        )


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Four runs of an arm and of a walk."""
    arm, walk = quartets = [_run(runner, subject) for subject in _SUBJECTS]
    result.rows += [_row(run) for run in (*arm, *walk)]
    _draw_errors(result, quartets)
    _draw_poses(result, [run for run in walk if run.pushed])
    for quartet in quartets:
        curves = {"time_s": quartet[0].closed.times[:-1]}
        for run in quartet:
            name = f"{run.loop}{'_pushed' if run.pushed else ''}_rad"
            curves[name] = mean_joint_errors(run.outcome.recording)
        result.add_curves(f"feedforward_{quartet[0].subject.character}", curves)
    same = all(run.same_states for run in (*arm, *walk) if not run.pushed)
    result.notes += [
        "Left alone, the torques played again give "
        + ("the same motion, to the last bit." if same else "another motion, which is a fault."),
        f"A push of {_SUBJECTS[0].impulse:g} N s is enough for the arm to drift away in open loop, "
        f"and one of {_SUBJECTS[1].impulse:g} N s for the walk to fall; with feedback both go on.",
        "Feedforward supposes that the system is as foreseen; feedback is for what is not.",
    ]


def _run(runner: StudyRunner, subject: _Subject) -> list[_Loop]:
    """Closed and open loop, left alone; the two of them, pushed."""
    closed = RunSpec(
        label=f"{subject.character}-closed",
        character=subject.character,
        duration=subject.duration,
        reference=subject.reference,
        simulator={"rate": _RATE, "wrench_duration": _PUSH_DURATION},
        controller=subject.controller,
    )
    first = runner.run(closed)
    run = first.recording
    file = runner.path(f"{subject.character}_efforts.csv")
    write_effort_series(file, run.layout, run.times[:-1], run.effort)
    controller = {"law": "feedforward", "feedforward": str(file)}
    opened = replace(closed, label=f"{subject.character}-open", controller=controller)
    push = plan_push(_PUSH_TIME, _RATE, subject.link, subject.force)
    outcomes = [first, runner.run(opened)]
    for case in (closed, opened):
        outcomes.append(runner.run(replace(case, label=f"{case.label}-pushed", pushes=[push])))
    return [
        _Loop(subject, loop, pushed, outcome, run)
        for (loop, pushed), outcome in zip(_STYLES, outcomes, strict=True)
    ]


def _row(run: _Loop) -> Row:
    times, error = run.outcome.recording.times[:-1], mean_joint_errors(run.outcome.recording)
    before, last = times <= _PUSH_TIME, times > times[-1] - _LAST
    return {
        "character": run.subject.character,
        "loop": run.loop,
        "push (N s)": run.subject.impulse if run.pushed else 0.0,
        "same states": run.same_states,
        "mean joint error before the push (rad)": float(error[before].mean()),
        "largest afterwards (rad)": float(error[~before].max()),
        "in the last 0.5 s (rad)": float(error[last].mean()),
        "fell": run.outcome.measured("fell"),
    }


def _draw_errors(result: StudyResult, quartets: Sequence[Sequence[_Loop]]) -> None:
    panels = result.add_panels("feedforward_error", 1, 2, (11.0, 4.4))
    titles = ("arm (kuka): sine of 0.3 rad", "walk of the humanoid, with root assistance")
    for axes, quartet, title in zip(panels, quartets, titles, strict=True):
        for run in quartet:
            error = np.maximum(mean_joint_errors(run.outcome.recording), _LEAST_ERROR)
            name = f"{run.loop} loop, {'pushed' if run.pushed else 'left alone'}"
            style = _STYLES[run.loop, run.pushed]
            axes.semilogy(run.outcome.recording.times[:-1], error, label=name, **style)
        end = _PUSH_TIME + _PUSH_DURATION
        axes.axvspan(_PUSH_TIME, end, color="tab:red", alpha=0.3, label="push")
        title = f"{title}; {quartet[0].subject.impulse:g} N s"
        label(axes, "time (s)", "mean joint error (rad)", title)


def _draw_poses(result: StudyResult, walks: Sequence[_Loop]) -> None:
    poses, captions = [], []
    for walk in walks:
        run = walk.outcome.recording
        rows = np.searchsorted(run.times, _STRIP_TIMES).clip(max=len(run.times) - 1)
        poses.append(run.position[rows])
        captions += [f"{walk.loop}, {time:.1f} s" for time in _STRIP_TIMES]
    picture = pose_strip(
        walks[0].closed.character,
        np.concatenate(poses),
        captions,
        columns=len(_STRIP_TIMES),
        size=_TILE,
    )
    title = (
        f"pushed by {_SUBJECTS[1].impulse:g} N s at {_PUSH_TIME:g} s; above: closed loop, "
        "below: the torques played again as if nothing had happened"
    )
    result.add_pictures(
        "feedforward_walk", {title: picture}, width=11.0, title_height=0.4, title_place="center"
    )
