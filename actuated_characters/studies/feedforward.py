"""Feedforward against feedback: the torques of a run played again, left alone and pushed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.render.stills import pose_strip
from actuated_characters.runs.planned_wrenches import PlannedPush
from actuated_characters.studies.framework.motion_replay import effort_table, errors_of, same_states
from actuated_characters.studies.framework.plots import label, make_panels
from actuated_characters.studies.framework.study import (
    Cell,
    RunResult,
    RunSpec,
    StudyResult,
    StudyRunner,
)
from msgs_config.arrays import FloatArray
from msgs_config.messages.clock import TickClock

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.figure import Figure

_RATE = 240  # Hz
_PUSH_TIME, _PUSH_DURATION = 1.0, 0.1  # s
_LAST = 0.5  # s, at the end of a run
_STRIP_TIMES = (0.9, 1.2, 1.5, 1.8, 2.1, 3.0)  # s
_TILE = (240, 260)  # pixels of a picture in the strip
_LEAST_ERROR = 1e-5  # rad; what is shown of less
_COLUMNS = (
    "character",
    "loop",
    "push (N s)",
    "same states",
    "mean joint error before the push (rad)",
    "largest afterwards (rad)",
    "in the last 0.5 s (rad)",
    "fell",
)


@dataclass(frozen=True)
class _Subject:
    """What moves, and what pushes it."""

    character: str
    link: str
    force: tuple[float, float, float]  # N
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
        reference={"reference": "clip", "clip": "walk"},
        controller={"law": "stable_pd"},
    ),
)


@dataclass(frozen=True)
class Quartet:
    """The four runs of a subject: closed and open loop, left alone and pushed."""

    closed: RunResult
    opened: RunResult
    closed_pushed: RunResult
    open_pushed: RunResult


class FeedforwardStudy:
    """What feedback is for."""

    name = "feedforward"
    title = "torques of a run, played again (open loop) and computed again (closed loop)"
    runs = 4 * len(_SUBJECTS)

    def run(self, runner: StudyRunner) -> StudyResult:
        """Four runs of an arm and of a walk."""
        quartets = [_run(runner, subject) for subject in _SUBJECTS]
        arm, walk = quartets
        return StudyResult(
            columns=_COLUMNS,
            rows=[
                row
                for subject, quartet in zip(_SUBJECTS, quartets, strict=True)
                for row in _rows(subject, quartet)
            ],
            figures={
                "feedforward_error": _draw_errors(quartets),
                "feedforward_walk": _strips(walk),
            },
            curves={
                f"feedforward_{subject.character}": _curves(quartet)
                for subject, quartet in zip(_SUBJECTS, quartets, strict=True)
            },
            notes=_notes(arm, walk),
        )


def _run(runner: StudyRunner, subject: _Subject) -> Quartet:
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
    table = effort_table(run.layout, run.times[:-1], run.effort)
    file = runner.write(f"{subject.character}_efforts.csv", table)
    opened = replace(
        closed,
        label=f"{subject.character}-open",
        controller={"law": "feedforward", "feedforward": file},
    )
    stamp_ns = TickClock(_RATE).stamp_ns(1 + round(_PUSH_TIME * _RATE))
    push = PlannedPush(stamp_ns, subject.link, (*subject.force, 0.0, 0.0, 0.0))

    def pushed(case: RunSpec) -> RunResult:
        return runner.run(replace(case, label=f"{case.label}-pushed", pushes=[push]))

    return Quartet(first, runner.run(opened), pushed(closed), pushed(opened))


def _named(quartet: Quartet) -> list[tuple[str, bool, RunResult]]:
    """Loop, whether it was pushed, and the run."""
    return [
        ("closed", False, quartet.closed),
        ("open", False, quartet.opened),
        ("closed", True, quartet.closed_pushed),
        ("open", True, quartet.open_pushed),
    ]


def _rows(subject: _Subject, quartet: Quartet) -> list[list[Cell]]:
    rows: list[list[Cell]] = []
    for loop, pushed, outcome in _named(quartet):
        times, error = errors_of(outcome.recording)
        before = times <= _PUSH_TIME
        last = times > times[-1] - _LAST
        rows.append(
            [
                subject.character,
                loop,
                subject.impulse if pushed else 0.0,
                same_states(quartet.closed.recording, outcome.recording),
                float(error[before].mean()),
                float(error[~before].max()),
                float(error[last].mean()),
                _fell(outcome),
            ]
        )
    return rows


def _fell(outcome: RunResult) -> bool | None:
    fell = outcome.summary["fell"]
    return fell if isinstance(fell, bool) else None


def _notes(arm: Quartet, walk: Quartet) -> list[str]:
    same = all(same_states(each.closed.recording, each.opened.recording) for each in (arm, walk))
    return [
        "Left alone, the torques played again give "
        + ("the same motion, to the last bit." if same else "another motion, which is a fault."),
        f"A push of {_SUBJECTS[0].impulse:g} N s is enough for the arm to drift away in open loop, "
        f"and one of {_SUBJECTS[1].impulse:g} N s for the walk to fall; with feedback both go on.",
        "Feedforward supposes that the system is as foreseen; feedback is for what is not.",
    ]


def _curves(quartet: Quartet) -> tuple[list[str], FloatArray]:
    """The errors over time, a column each; NaN after a run that ended early."""
    times, _ = errors_of(quartet.closed.recording)
    names, columns = ["time_s"], [times]
    for loop, pushed, outcome in _named(quartet):
        _, error = errors_of(outcome.recording)
        names.append(f"{loop}{'_pushed' if pushed else ''}_rad")
        columns.append(np.append(error, np.full(len(times) - len(error), np.nan)))
    return names, np.stack(columns, axis=1)


def _draw_errors(quartets: Sequence[Quartet]) -> "Figure":
    figure, panels = make_panels(1, 2, (11.0, 4.4))
    styles = {
        ("closed", False): {"color": "tab:blue", "linewidth": 5.0, "alpha": 0.35},
        ("open", False): {"color": "black", "linestyle": ":", "linewidth": 1.5},
        ("closed", True): {"color": "tab:blue", "linewidth": 1.2},
        ("open", True): {"color": "tab:orange", "linewidth": 1.5},
    }
    titles = ("arm (kuka): sine of 0.3 rad", "walk of the humanoid, with root assistance")
    for axes, quartet, subject, title in zip(panels, quartets, _SUBJECTS, titles, strict=True):
        for loop, pushed, outcome in _named(quartet):
            times, error = errors_of(outcome.recording)
            name = f"{loop} loop, {'pushed' if pushed else 'left alone'}"
            style = styles[loop, pushed]
            axes.semilogy(times, np.maximum(error, _LEAST_ERROR), label=name, **style)
        axes.axvspan(
            _PUSH_TIME, _PUSH_TIME + _PUSH_DURATION, color="tab:red", alpha=0.3, label="push"
        )
        label(axes, "time (s)", "mean joint error (rad)", f"{title}; {subject.impulse:g} N s")
    return figure


def _strips(walk: Quartet) -> "Figure":
    poses, captions = [], []
    for name, outcome in (("closed", walk.closed_pushed), ("open", walk.open_pushed)):
        run = outcome.recording
        rows = np.searchsorted(run.times, _STRIP_TIMES).clip(max=len(run.times) - 1)
        poses.append(run.position[rows])
        captions += [f"{name}, {time:.1f} s" for time in _STRIP_TIMES]
    character = walk.closed_pushed.recording.character
    columns = len(_STRIP_TIMES)
    together = np.concatenate(poses)
    picture = pose_strip(character, together, captions, columns=columns, size=_TILE)
    height, width, _ = picture.shape
    figure, (axes,) = make_panels(1, 1, (11.0, 11.0 * height / width + 0.4))
    axes.imshow(picture)
    axes.set_title(
        f"pushed by {_SUBJECTS[1].impulse:g} N s at {_PUSH_TIME:g} s; above: closed loop, "
        "below: the torques played again as if nothing had happened",
        fontsize="medium",
    )
    axes.set_axis_off()
    return figure


STUDY = FeedforwardStudy()
