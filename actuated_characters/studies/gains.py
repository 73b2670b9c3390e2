"""Small, normal and large stiffness and damping, with the reference's velocity and without."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import joint_errors
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.stills import strip
from actuated_characters.studies.framework.plots import THEORY, label, make_panels, show_pictures
from actuated_characters.studies.framework.study import (
    Cell,
    RunResult,
    RunSpec,
    StudyResult,
    StudyRunner,
)
from actuated_characters.studies.framework.tracking import inertialess_response, lag, overshoot
from msgs_config.arrays import FloatArray

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.figure import Figure

_CHARACTER, _KNEE = "humanoid", "right_knee"
_RATE, _DURATION = 240, 4.0  # Hz, s
_SETTLED = 0.5  # s; what is before is the start
_LONGEST_LAG = 0.4  # s
_SHOWN = 3.0  # s
_FACTORS = {  # of stiffness and damping; the lecture's two rows of three pictures
    "normal stiffness": (1.0, 1.0),
    "small stiffness": (0.1, 1.0),
    "large stiffness": (10.0, 1.0),
    "normal damping": (1.0, 1.0),
    "small damping": (1.0, 0.1),
    "large damping": (1.0, 10.0),
}
_VELOCITIES = {"clip": "with reference velocity", "zero": "without"}
_PICTURES, _SIZE = 10, (180, 230)
_PICTURED = (1.27, 2.54)  # s, the second cycle


@dataclass(frozen=True)
class _Knee:
    """The knee's angle, its reference, and what theory says of a knee without inertia."""

    times: FloatArray  # (t,) s
    angle: FloatArray  # (t,) rad
    reference: FloatArray  # (t,) rad
    theory: FloatArray  # (t,) rad

    def settled(self) -> "_Knee":
        """Without the start."""
        rows = self.times >= _SETTLED
        return _Knee(self.times[rows], self.angle[rows], self.reference[rows], self.theory[rows])

    def lags(self) -> tuple[float, float]:
        """By which it comes after its reference, and should by theory, s."""
        known = self.settled()
        late, expected = (
            lag(angle, known.reference, 1.0 / _RATE, _LONGEST_LAG)
            for angle in (known.angle, known.theory)
        )
        return late, expected


class GainsStudy:
    """The humanoid walks with root assistance, so that what is seen is the joints' gains."""

    name = "gains"
    title = "stiffness and damping x 0.1, 1, 10: the walk, with root assistance"
    runs = 10

    def run(self, runner: StudyRunner) -> StudyResult:
        """Walk by each pair of factors, with and without the reference's velocity."""
        runs = {
            (factors, velocity): runner.run(_case(factors, velocity))
            for factors in dict.fromkeys(_FACTORS.values())
            for velocity in _VELOCITIES
        }
        return StudyResult(
            columns=(
                "gains",
                "reference velocity",
                "joint error (rad)",
                "knee overshoot / range",
                "knee lag (ms)",
                "by theory (ms)",
                "share saturated",
                "ends at (s)",
            ),
            rows=[
                _row(name, velocity, runs[factors, velocity])
                for name, factors in _FACTORS.items()
                for velocity in _VELOCITIES
            ],
            figures={
                self.name: _draw(runs),
                "gains_poses": show_pictures(_pictures(runs)),
            },
            curves={"gains_knee": _curves(runs)},
            notes=_notes(runs),
        )


_Runs = Mapping[tuple[tuple[float, float], str], RunResult]


def _case(factors: tuple[float, float], velocity: str) -> RunSpec:
    stiffness, damping = factors
    return RunSpec(
        f"p{stiffness:g}_d{damping:g}_{velocity}",
        _CHARACTER,
        _DURATION,
        {"reference": "clip", "clip": "walk"},
        {"rate": _RATE},
        {
            "gain_scale.p": stiffness,
            "gain_scale.d": damping,
            "reference_velocity": velocity,
        },
    )


def _knee(run: Recording, factors: tuple[float, float]) -> _Knee:
    entry, gains = run.layout.joint(_KNEE).start, run.character.gains[_KNEE]
    reference = run.reference_position[:-1, entry]  # the last state may have none
    theory = inertialess_response(
        reference,
        run.reference_velocity[:-1, entry],  # zero where it is not followed
        factors[0] * gains.stiffness,
        factors[1] * gains.damping,
        1.0 / _RATE,
    )
    return _Knee(run.times[:-1], run.position[:-1, entry], reference, theory)


def _row(name: str, velocity: str, outcome: RunResult) -> tuple[Cell, ...]:
    run = outcome.recording
    errors = joint_errors(run.layout, run.position[:-1], run.reference_position[:-1])
    saturated = outcome.summary["saturated_fraction"]
    knee: tuple[Cell, ...] = (None, None, None)
    if not outcome.diverged:
        angles = _knee(run, _FACTORS[name])
        known = angles.settled()
        late, expected = angles.lags()
        knee = overshoot(known.angle, known.reference), 1e3 * late, 1e3 * expected
    return (
        name,
        velocity,
        float(errors.mean()),
        *knee,
        saturated if isinstance(saturated, float) else None,
        float(run.times[-1]),
    )


def _notes(runs: _Runs) -> Sequence[str]:
    notes = [
        "without the reference's velocity damping holds back: a slow motion lags by kd / kp; with "
        "it, it does not",
        "small damping does not oscillate here, as stable PD has a damping kp h of its own",
    ]
    for (factors, velocity), outcome in runs.items():
        if outcome.diverged:
            notes.append(
                f"stiffness x {factors[0]:g}, damping x {factors[1]:g}, velocity {velocity}: "
                f"{outcome.diverged}; efforts at their limits are not those that the implicit "
                "solve counts on"
            )
    return notes


def _draw(runs: _Runs) -> "Figure":
    figure, panels = make_panels(2, 3, (13.0, 7.0), same_x=True)
    for panel, (name, factors) in zip(panels, _FACTORS.items(), strict=True):
        said = []
        for velocity, named in _VELOCITIES.items():
            outcome = runs[factors, velocity]
            knee = _knee(outcome.recording, factors)
            (line,) = panel.plot(knee.times, knee.angle, label=named, linewidth=2.0, alpha=0.8)
            panel.plot(knee.times, knee.theory, **{**THEORY, "color": line.get_color()})
            if outcome.diverged:
                panel.plot(knee.times[-1:], knee.angle[-1:], "x", color="tab:red", markersize=10)
                said.append("diverges")
            else:
                late, expected = knee.lags()
                said.append(f"{round(1e3 * late)} ms (theory {round(1e3 * expected)})")
        reference = _knee(runs[factors, "clip"].recording, factors)
        panel.plot(reference.times, reference.reference, "k", linewidth=0.8, label="reference")
        title = f"{name}\nlag {said[0]}; without velocity {said[1]}"
        label(panel, "time (s)", "right knee (rad)", title, legend=None)
        panel.title.set_fontsize("small")
        panel.set_xlim(0.0, _SHOWN)
        panel.set_ylim(float(reference.reference.min()) - 0.4, 0.4)
    panels[0].plot([], [], label="theory: no inertia", **THEORY)
    panels[0].legend(loc="lower left", fontsize="x-small", ncols=2)
    return figure


def _pictures(runs: _Runs) -> dict[str, Picture]:
    """Poses of the second cycle, the reference as a ghost; its velocity followed."""
    pictures = {}
    for name, factors in _FACTORS.items():
        run = runs[factors, "clip"].recording
        end = float(run.times[-2])
        times = np.linspace(min(_PICTURED[0], end), min(_PICTURED[1], end), _PICTURES).tolist()
        pictures[f"{name}, with reference velocity; the reference in green"] = strip(
            run, times, columns=_PICTURES, ghost=True, size=_SIZE
        )
    return pictures


def _curves(runs: _Runs) -> tuple[Sequence[str], FloatArray]:
    """The knee's reference and its angles; NaN after a divergence."""
    whole = [outcome.recording for outcome in runs.values() if not outcome.diverged]
    longest = _knee(whole[0], (1.0, 1.0))
    names, columns = ["time_s", "reference_rad"], [longest.times, longest.reference]
    for (factors, velocity), outcome in runs.items():
        angle = _knee(outcome.recording, factors).angle
        missing = len(longest.times) - len(angle)
        columns.append(np.pad(angle, (0, missing), constant_values=np.nan))
        names.append(f"p{factors[0]:g}_d{factors[1]:g}_{velocity}_rad")
    return names, np.column_stack(columns)


STUDY = GainsStudy()
