"""One mass on a slider: what P, PD and PID do with a weight, and when they are unstable."""

import math
from collections.abc import Sequence

import numpy as np

from actuated_characters.studies.framework.lift_figures import (
    draw_errors,
    draw_laws,
    draw_stability,
)
from actuated_characters.studies.framework.study import Cell, RunSpec, StudyResult, StudyRunner
from actuated_characters.studies.theory import second_order
from actuated_characters.studies.theory.lift_responses import (
    CRITICAL,
    MASS,
    PERIOD,
    RATE,
    STIFFNESS,
    TARGET,
    Bound,
    Gains,
    Response,
    error_by_theory,
    find_bound,
    ratio_by_theory,
    stable_by_theory,
)
from msgs_config.arrays import FloatArray

_LENGTH, _SHORT = 4.0, 1.5  # s, of a run
_COLUMNS = (
    "law",
    "kp (N/m)",
    "kd (N s/m)",
    "ki (N/(m s))",
    "overshoot (%)",
    "settling time (s)",
    "steady-state error (m)",
    "error by theory (m)",
    "damping ratio",
    "ratio by theory",
    "stable / by theory",
)


class LiftStudy:
    """The lecture's first PD figures, on 1 kg."""

    name = "lift"
    title = "1 kg on a slider, from rest at 0 m to 1 m, 240 Hz"
    runs = 26

    def run(self, runner: StudyRunner) -> StudyResult:
        """Run each law with gains that show what it is like, then look for the bounds."""

        def respond(gains: Gains, duration: float = _LENGTH) -> Response:
            return _respond(runner, gains, duration)

        limit = second_order.largest_integral_gain(STIFFNESS, CRITICAL, MASS)
        p = respond(Gains("p", STIFFNESS, 0.0))
        pd = [respond(Gains("pd", STIFFNESS, damping)) for damping in (4.0, CRITICAL, 60.0)]
        implicit = [respond(Gains("stable_pd", STIFFNESS, kd)) for kd in (4.0, CRITICAL)]
        gravity = respond(Gains("pd_gravity", STIFFNESS, CRITICAL))
        pid = [
            respond(Gains("pid", STIFFNESS, CRITICAL, share * limit)) for share in (0.1, 0.8, 1.2)
        ]
        stiff = [respond(Gains.critical("pd", kp)) for kp in (25.0, 400.0, 1600.0)]
        stiff.append(respond(Gains.critical("stable_pd", 400.0)))
        bounds = [
            find_bound(lambda gains: respond(gains, _SHORT), law, theory)
            for law, theory in (
                ("pd", second_order.largest_explicit_stiffness(MASS, PERIOD)),
                ("stable_pd", second_order.largest_stable_pd_stiffness(MASS, PERIOD)),
            )
        ]
        ends = [response for bound in bounds for response in (bound.below, bound.above)]
        responses = [p, *pd, *implicit, gravity, *pid, *stiff]
        return StudyResult(
            columns=_COLUMNS,
            rows=[
                *(_row(response) for response in responses),
                *(_row(response, at_bound=True) for response in ends),
            ],
            figures={
                "lift_laws": draw_laws([p, *pd], [pd[1], implicit[1], gravity, pid[0]], pid),
                "lift_error": draw_errors([pd[1], implicit[1], *stiff]),
                "lift_stability": draw_stability(bounds),
            },
            curves={"lift_heights": _curves(responses)},
            notes=_notes(bounds),
        )


def _respond(runner: StudyRunner, gains: Gains, duration: float) -> Response:
    numbers = f"{gains.stiffness:.0f}-{gains.damping:.0f}-{gains.integral:.0f}"
    outcome = runner.run(
        RunSpec(
            label=f"{gains.law}-{numbers}",
            character="lift",
            duration=duration,
            reference={"reference": "hold"},
            simulator={"rate": RATE, "initial_position": [0.0]},
            controller={
                "law": gains.law,
                "gains.height.p": gains.stiffness,
                "gains.height.d": gains.damping,
                "gains.height.i": gains.integral,
            },
        )
    )
    recording = outcome.recording
    return Response(gains, recording.times, recording.position[:, 0], bool(outcome.diverged))


def _row(response: Response, *, at_bound: bool = False) -> list[Cell]:
    """A line of the table; at its bound a motion is none that continuous time knows of."""
    gains, stable = response.gains, response.stable
    ideal = stable and not at_bound
    rest = response.rest if stable else math.nan
    settles = stable and gains.damping > 0.0
    beyond = second_order.measured_overshoot(response.height, rest) if ideal else None
    return [
        gains.law,
        round(gains.stiffness),
        round(gains.damping),
        round(gains.integral),
        None if beyond is None else round(100.0 * beyond, 3),
        second_order.settling_time(response.times, response.height, rest) if settles else None,
        round(TARGET - rest, 8) if stable else None,
        error_by_theory(gains),
        response.ratio if ideal else None,
        None if at_bound else ratio_by_theory(gains),
        f"{_yes(stable)} / {_yes(stable_by_theory(gains))}",
    ]


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "no"


def _curves(responses: Sequence[Response]) -> tuple[list[str], FloatArray]:
    """The heights over time, a column each; NaN after one has diverged."""
    times = max((response.times for response in responses), key=len)
    names, columns = ["time_s"], [times]
    for response in responses:
        gains = response.gains
        numbers = f"kp{gains.stiffness:g}_kd{gains.damping:g}_ki{gains.integral:g}"
        names.append(f"{gains.law}_{numbers}_m")
        rest = np.full(len(times) - len(response.height), np.nan)
        columns.append(np.append(response.height, rest))
    return names, np.stack(columns, axis=1)


def _notes(bounds: Sequence[Bound]) -> list[str]:
    explicit, implicit = bounds
    found = [
        f"{bound.law} is stable at {bound.below.gains.stiffness:.0f} N/m, not at "
        f"{bound.above.gains.stiffness:.0f}; by theory up to {bound.theory:.0f}."
        for bound in bounds
    ]
    return [
        "P swings forever; PD comes to rest m g / kp below the target, however it is damped.",
        "Stable PD has that error too: it knows gravity only to foresee the motion. Gravity "
        "compensation and the integral of PID remove it; too much integral is unstable.",
        "Damped critically, by the stiffness alone: " + " ".join(found),
        f"At the same rate stable PD may be {implicit.found / explicit.found:.1f} times stiffer.",
    ]


STUDY = LiftStudy()
