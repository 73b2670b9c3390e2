"""One mass on a slider under P, PD and PID: steady-state errors, and bounds of stability."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from actuated_characters.render.plots import THEORY, label
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import HOLD, RunSpec, StudyRunner
from lecture.theory import second_order
from lecture.theory.lift_responses import (
    CRITICAL,
    MASS,
    PERIOD,
    RATE,
    STIFFNESS,
    TARGET,
    WEIGHT,
    Bound,
    LiftLaw,
    Response,
    find_bound,
)

TITLE = "1 kg on a slider, from rest at 0 m to 1 m, 240 Hz"
RUNS = 26

_LENGTH, _SHORT = 4.0, 1.5  # s, of a run
_LIMIT = second_order.largest_integral_gain(STIFFNESS, CRITICAL, MASS)


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Run each law with typical gains, then look for the bounds of stability."""

    def respond(law: str, kp: float = STIFFNESS, kd: float = CRITICAL, ki: float = 0.0) -> Response:
        return _respond(runner, LiftLaw(law, kp, kd, ki), _LENGTH)

    p = respond("p", kd=0.0)
    pd = [respond("pd", kd=kd) for kd in (4.0, CRITICAL, 60.0)]
    implicit = [respond("stable_pd", kd=kd) for kd in (4.0, CRITICAL)]
    gravity = respond("pd_gravity")
    pid = [respond("pid", ki=share * _LIMIT) for share in (0.1, 0.8, 1.2)]
    stiff = [
        _respond(runner, LiftLaw.critical(law, kp), _LENGTH)
        for law, kp in (("pd", 25.0), ("pd", 400.0), ("pd", 1600.0), ("stable_pd", 400.0))
    ]
    bounds = [
        find_bound(lambda gains: _respond(runner, gains, _SHORT), law, theory)
        for law, theory in (
            ("pd", second_order.largest_explicit_stiffness(MASS, PERIOD)),
            ("stable_pd", second_order.largest_stable_pd_stiffness(MASS, PERIOD)),
        )
    ]
    responses = [p, *pd, *implicit, gravity, *pid, *stiff]
    result.rows += [_row(response) for response in responses]
    for bound in bounds:
        result.rows += [_row(each, at_bound=True) for each in (bound.below, bound.above)]
    laws = result.add_panels("lift_laws", 1, 3, (12.0, 4.2))
    _draw_damping(laws[0], [p, *pd])
    _draw_removed(laws[1], [pd[1], implicit[1], gravity, pid[0]])
    _draw_integral(laws[2], pid)
    _draw_errors(result, [pd[1], implicit[1], *stiff])
    _draw_stability(result, bounds)
    times = max((response.times for response in responses), key=len)
    heights = {_curve_name(response.gains): response.height for response in responses}
    result.add_curves("lift_heights", {"time_s": times, **heights})
    _add_notes(result, *bounds)


def _respond(runner: StudyRunner, gains: LiftLaw, duration: float) -> Response:
    numbers = f"{gains.stiffness:.0f}-{gains.damping:.0f}-{gains.integral:.0f}"
    controller = {
        "law": gains.law,
        "gains.height.p": gains.stiffness,
        "gains.height.d": gains.damping,
        "gains.height.i": gains.integral,
    }
    simulator = {"rate": RATE, "initial_position": [0.0]}
    case = RunSpec(f"{gains.law}-{numbers}", "lift", duration, HOLD, simulator, controller)
    outcome = runner.run(case)
    recording = outcome.recording
    return Response(gains, recording.times, recording.position[:, 0], bool(outcome.diverged))


def _row(response: Response, *, at_bound: bool = False) -> Row:
    """A row of the table; at a bound, without the measures that suppose continuous time."""
    gains, stable = response.gains, response.stable
    ideal = stable and not at_bound
    rest = response.rest if stable else math.nan
    settles = stable and gains.damping > 0.0
    beyond = second_order.measured_overshoot(response.height, rest) if ideal else None
    return {
        "law": gains.law,
        "kp (N/m)": round(gains.stiffness),
        "kd (N s/m)": round(gains.damping),
        "ki (N/(m s))": round(gains.integral),
        "overshoot (%)": None if beyond is None else round(100.0 * beyond, 3),
        "settling time (s)": (
            second_order.settling_time(response.times, response.height, rest) if settles else None
        ),
        "steady-state error (m)": round(TARGET - rest, 8) if stable else None,
        "error by theory (m)": gains.error_by_theory,
        "damping ratio": response.ratio if ideal else None,
        "ratio by theory": None if at_bound else gains.ratio_by_theory,
        "stable / by theory": f"{_yes(stable)} / {_yes(gains.stable_by_theory)}",
    }


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "no"


def _curve_name(gains: LiftLaw) -> str:
    return f"{gains.law}_kp{gains.stiffness:g}_kd{gains.damping:g}_ki{gains.integral:g}_m"


def _add_notes(result: StudyResult, explicit: Bound, implicit: Bound) -> None:
    found = [
        f"{bound.law} is stable at {bound.below.gains.stiffness:.0f} N/m, not at "
        f"{bound.above.gains.stiffness:.0f}; by theory up to {bound.theory:.0f}."
        for bound in (explicit, implicit)
    ]
    result.remarks += [
        "P swings forever; PD comes to rest m g / kp below the target, however it is damped.",
        "Stable PD has that error too: it knows gravity only to foresee the motion. Gravity "
        "compensation and the integral of PID remove it; too much integral is unstable.",
        "Damped critically, by the stiffness alone: " + " ".join(found),
        f"At the same rate stable PD may be {implicit.found / explicit.found:.1f} times stiffer.",
    ]


def _draw_damping(axes: Axes, responses: Sequence[Response]) -> None:
    names = ("P", "PD, too little damping", "PD, critical", "PD, too much")
    for response, name in zip(responses, names, strict=True):
        times, gains = response.times, response.gains
        axes.plot(times, response.height, label=f"{name}: kd {gains.damping:g}")
        theory = second_order.step_response(times, gains.stiffness, gains.damping, MASS, WEIGHT)
        axes.plot(times, theory, **THEORY)
    axes.plot([], [], **THEORY, label="theory")
    axes.set_ylim(-0.05, 3.0)
    label(axes, "time (s)", "height (m)", f"damping (kp {STIFFNESS:g} N/m, kd in N s/m)")


def _draw_removed(axes: Axes, responses: Sequence[Response]) -> None:
    for response in responses:
        law, integral = response.gains.law, response.gains.integral
        name = f"{law}, ki {integral:g}" if law == "pid" else law
        style = "--" if law == "stable_pd" else "-"
        axes.plot(response.times, response.height, style, label=name)
    axes.axhline(TARGET, **THEORY)
    axes.axhline(TARGET - WEIGHT / STIFFNESS, **THEORY, label="target, and m g / kp below it")
    axes.set_ylim(0.6, 1.25)
    label(axes, "time (s)", "height (m)", "what removes the steady-state error")


def _draw_integral(axes: Axes, responses: Sequence[Response]) -> None:
    for response in responses:
        share = response.gains.integral / _LIMIT
        axes.plot(response.times, response.height, label=f"{share:.1f} kp kd / m")
    axes.axhline(TARGET, **THEORY)
    label(axes, "time (s)", "height (m)", "PID: the integral gain ki, stable below kp kd / m")


def _draw_errors(result: StudyResult, responses: Sequence[Response]) -> None:
    """The steady-state error over the stiffness."""
    (axes,) = result.add_panels("lift_error", 1, 1, (7.0, 4.6))
    for law, marker in (("pd", "o"), ("stable_pd", "x")):
        of_law = [response for response in responses if response.gains.law == law]
        stiffness = [response.gains.stiffness for response in of_law]
        errors = [TARGET - response.rest for response in of_law]
        axes.loglog(stiffness, errors, marker, markersize=9, fillstyle="none", label=law)
    along = np.geomspace(15.0, 2500.0, 2)
    axes.loglog(along, WEIGHT / along, **THEORY, label="m g / kp")
    title = "PD holds 1 kg below its target, the less the stiffer it is"
    label(axes, "stiffness kp (N/m)", "steady-state error (m)", title)


def _draw_stability(result: StudyResult, bounds: Sequence[Bound]) -> None:
    """Heights just below and just above each bound, and where all the runs were."""
    *panels, regions = result.add_panels("lift_stability", 1, 3, (12.0, 4.2))
    for axes, bound in zip(panels, bounds, strict=True):
        for response in (bound.above, bound.below):
            share = response.gains.stiffness / bound.theory
            axes.plot(response.times, response.height, ".-", label=f"kp {share:.3f} of the bound")
        axes.set_xlim(0.0, 0.3)
        axes.set_ylim(-1.0, 3.0)
        title = f"{bound.law}: theory {bound.theory:.0f} N/m, found {bound.found:.0f}"
        label(axes, "time (s)", "height (m)", title, legend="upper right")
    _draw_regions(regions, bounds)


def _draw_regions(axes: Axes, bounds: Sequence[Bound]) -> None:
    """The plane of stiffness and damping without units, and where the runs were in it."""
    damping = np.geomspace(0.05, 10.0, 400)  # kd h / m; the curves: kp h^2 / m
    for curve, style, color, name in (
        (4.0 - 2.0 * damping, "--", "tab:blue", "pd: kp h² + 2 kd h < 4 m"),
        ((4.0 + 2.0 * damping) / 3.0, "--", "tab:orange", "stable_pd: 3 kp h² < 4 m + 2 kd h"),
        (damping**2 / 4.0, ":", "grey", "critical damping"),
    ):
        axes.plot(damping, curve, style, color=color, label=name)
    for bound, color in zip(bounds, ("tab:blue", "tab:orange"), strict=True):
        for response in bound.evaluated:
            gains, marker = response.gains, "o" if response.stable else "x"
            x, y = gains.damping * PERIOD / MASS, gains.stiffness * PERIOD**2 / MASS
            axes.plot(x, y, marker, color=color, fillstyle="none")
    axes.plot([], [], "o", color="black", fillstyle="none", label="run: stable")
    axes.plot([], [], "x", color="black", label="run: unstable")
    axes.set(xscale="log", yscale="log", ylim=(0.1, 10.0))
    label(axes, "damping kd h / m", "stiffness kp h² / m", "stable below the dashed lines")
