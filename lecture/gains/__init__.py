"""Small, normal and large stiffness and damping: a walk, and a step of the pose."""

from collections.abc import Mapping

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.plots import THEORY, label
from actuated_characters.render.stills import strip
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import WALK, RunResult, RunSpec, StudyRunner
from lecture.framework.tracking import (
    inertialess_response,
    joint_errors,
    lag,
    overshoot,
)
from lecture.gains.step import Factors, describe, draw_steps, run_steps
from msgs_config.arrays import FloatArray

TITLE = "stiffness and damping x 0.1, 1, 10: the walk and a step, with root assistance"
RUNS = 15

_CHARACTER, _KNEE = "humanoid", "right_knee"
_RATE, _DURATION = 240, 4.0  # Hz, s
_MEASURED_SINCE = 0.5  # s; the time before is the start
_LONGEST_LAG = 0.4  # s
_SHOWN_SECONDS = 3.0  # s
FACTORS: Mapping[str, Factors] = {
    "normal stiffness": (1.0, 1.0),
    "small stiffness": (0.1, 1.0),
    "large stiffness": (10.0, 1.0),
    "normal damping": (1.0, 1.0),
    "small damping": (1.0, 0.1),
    "large damping": (1.0, 10.0),
}
"""Factors of stiffness and damping; the lecture's two rows of three pictures."""

_VELOCITIES = {"clip": "with reference velocity", "zero": "without"}
_PICTURES, _SIZE = 10, (180, 230)
_PICTURED_SPAN = (1.27, 2.54)  # s, the second cycle


_Runs = Mapping[tuple[Factors, str], RunResult]


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Walk by each pair of factors, with and without the reference's velocity; and lift a leg.

    With root assistance, so that what is seen is the joints' gains.
    """
    runs = {
        (factors, velocity): runner.run(_case(factors, velocity))
        for factors in dict.fromkeys(FACTORS.values())
        for velocity in _VELOCITIES
    }
    steps = run_steps(runner, list(dict.fromkeys(FACTORS.values())))
    result.rows += [
        _row(name, velocity, runs[factors, velocity])
        for name, factors in FACTORS.items()
        for velocity in _VELOCITIES
    ]
    _draw(result, runs)
    _draw_poses(result, runs)
    draw_steps(result, FACTORS, steps)
    times, _, reference, _ = _knee(runs[(1.0, 1.0), "clip"].recording, (1.0, 1.0))
    curves = {"time_s": times, "reference_rad": reference}
    result.remarks += [
        "without the reference's velocity damping holds back: a slow motion lags by kd / kp; with "
        "it, it does not",
        "along the walk, which is slow, small damping does not oscillate; lifted at once a leg "
        "overshoots, though stable PD adds a damping kp h: " + describe(steps, FACTORS),
    ]
    for ((p, d), velocity), outcome in runs.items():
        curves[f"p{p:g}_d{d:g}_{velocity}_rad"] = _knee(outcome.recording, (p, d))[1]
        if outcome.diverged:
            result.remarks.append(
                f"stiffness x {p:g}, damping x {d:g}, velocity {velocity}: {outcome.diverged}; "
                "efforts at their limits are not those that the implicit solve counts on"
            )
    result.add_curves("gains_knee", curves)


def _case(factors: Factors, velocity: str) -> RunSpec:
    p, d = factors
    controller = {"gain_scale.p": p, "gain_scale.d": d, "reference_velocity": velocity}
    label = f"p{p:g}_d{d:g}_{velocity}"
    return RunSpec(label, _CHARACTER, _DURATION, WALK, {"rate": _RATE}, controller)


def _knee(run: Recording, factors: Factors) -> FloatArray:
    """Times in s, the knee's angle, its reference, and that by theory, without inertia, in rad.

    Rows of an array (4, t).
    """
    entry, gains = run.layout.joint(_KNEE).start, run.character.gains[_KNEE]
    reference = run.reference_position[:-1, entry]  # the last state may have no reference
    theory = inertialess_response(
        reference,
        run.reference_velocity[:-1, entry],  # zero where the reference velocity is not followed
        factors[0] * gains.stiffness,
        factors[1] * gains.damping,
        1.0 / _RATE,
    )
    return np.array((run.times[:-1], run.position[:-1, entry], reference, theory))


def _row(name: str, velocity: str, outcome: RunResult) -> Row:
    run, overshoots, late, expected = outcome.recording, None, None, None
    if not outcome.diverged:
        knee = _knee(run, FACTORS[name])
        _, angle, reference, theory = knee[:, knee[0] >= _MEASURED_SINCE]
        overshoots = overshoot(angle, reference)
        late, expected = (
            1e3 * lag(values, reference, 1.0 / _RATE, _LONGEST_LAG) for values in (angle, theory)
        )
    return {
        "gains": name,
        "reference velocity": velocity,
        "joint error (rad)": float(joint_errors(run).mean()),
        "knee overshoot / range": overshoots,
        "knee lag (ms)": late,
        "by theory (ms)": expected,
        "share saturated": outcome.measured("saturated_fraction"),
        "ends at (s)": float(run.times[-1]),
    }


def _draw(result: StudyResult, runs: _Runs) -> None:
    panels = result.add_panels(result.name, 2, 3, (13.0, 7.0), same_x=True)
    lags = zip(result.column("knee lag (ms)"), result.column("by theory (ms)"), strict=True)
    for panel, (name, factors) in zip(panels, FACTORS.items(), strict=True):
        texts = []
        for velocity, named in _VELOCITIES.items():
            outcome = runs[factors, velocity]
            times, angle, _, theory = _knee(outcome.recording, factors)
            (line,) = panel.plot(times, angle, label=named, linewidth=2.0, alpha=0.8)
            panel.plot(times, theory, **{**THEORY, "color": line.get_color()})
            late, expected = next(lags)
            if outcome.diverged:
                panel.plot(times[-1:], angle[-1:], "x", color="tab:red", markersize=10)
                texts.append("diverges")
            else:
                texts.append(f"{round(late)} ms (theory {round(expected)})")
        times, _, reference, _ = _knee(runs[factors, "clip"].recording, factors)
        panel.plot(times, reference, "k", linewidth=0.8, label="reference")
        title = f"{name}\nlag {texts[0]}; without velocity {texts[1]}"
        label(panel, "time (s)", "right knee (rad)", title, legend=None)
        panel.title.set_fontsize("small")
        panel.set_xlim(0.0, _SHOWN_SECONDS)
        panel.set_ylim(float(reference.min()) - 0.4, 0.4)
    panels[0].plot([], [], label="theory: no inertia", **THEORY)
    panels[0].legend(loc="lower left", fontsize="x-small", ncols=2)


def _draw_poses(result: StudyResult, runs: _Runs) -> None:
    """Poses of the second cycle, the reference as a ghost; its velocity followed."""
    pictures = {}
    for name, factors in FACTORS.items():
        run = runs[factors, "clip"].recording
        end = float(run.times[-2])
        times = np.linspace(
            min(_PICTURED_SPAN[0], end), min(_PICTURED_SPAN[1], end), _PICTURES
        ).tolist()
        pictures[f"{name}, with reference velocity; the reference in green"] = strip(
            run, times, columns=_PICTURES, ghost=True, size=_SIZE
        )
    result.add_pictures("gains_poses", pictures)
