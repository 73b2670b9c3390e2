"""The pictures of the study `lift`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.studies.framework.plots import THEORY, label, make_panels
from actuated_characters.studies.theory import second_order
from actuated_characters.studies.theory.lift_responses import (
    CRITICAL,
    MASS,
    PERIOD,
    STIFFNESS,
    TARGET,
    WEIGHT,
    Bound,
    Response,
)

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_laws(
    damped: Sequence[Response], removed: Sequence[Response], integral: Sequence[Response]
) -> "Figure":
    """Heights over time: by damping, by what removes the steady-state error, by integral gain."""
    figure, (first, second, third) = make_panels(1, 3, (12.0, 4.2))
    for response, name in zip(
        damped, ("P", "PD, too little damping", "PD, critical", "PD, too much"), strict=True
    ):
        gains = response.gains
        first.plot(response.times, response.height, label=f"{name}: kd {gains.damping:g}")
        theory = second_order.step_response(
            response.times, gains.stiffness, gains.damping, MASS, WEIGHT
        )
        first.plot(response.times, theory, **THEORY)
    first.plot([], [], **THEORY, label="theory")
    first.set_ylim(-0.05, 3.0)
    label(first, "time (s)", "height (m)", f"damping (kp {STIFFNESS:g} N/m, kd in N s/m)")
    for response in removed:
        law, integral_gain = response.gains.law, response.gains.integral
        name = f"{law}, ki {integral_gain:g}" if law == "pid" else law
        second.plot(
            response.times, response.height, "--" if law == "stable_pd" else "-", label=name
        )
    second.axhline(TARGET, **THEORY)
    second.axhline(TARGET - WEIGHT / STIFFNESS, **THEORY, label="target, and m g / kp below it")
    second.set_ylim(0.6, 1.25)
    label(second, "time (s)", "height (m)", "what removes the steady-state error")
    limit = second_order.largest_integral_gain(STIFFNESS, CRITICAL, MASS)
    for response in integral:
        share = response.gains.integral / limit
        third.plot(response.times, response.height, label=f"{share:.1f} kp kd / m")
    third.axhline(TARGET, **THEORY)
    label(third, "time (s)", "height (m)", "PID: the integral gain ki, stable below kp kd / m")
    return figure


def draw_errors(responses: Sequence[Response]) -> "Figure":
    """The steady-state error over the stiffness."""
    figure, (axes,) = make_panels(1, 1, (7.0, 4.6))
    for law, marker in (("pd", "o"), ("stable_pd", "x")):
        its = [response for response in responses if response.gains.law == law]
        stiffness = [response.gains.stiffness for response in its]
        errors = [TARGET - response.rest for response in its]
        axes.loglog(stiffness, errors, marker, markersize=9, fillstyle="none", label=law)
    along = np.geomspace(15.0, 2500.0, 2)
    axes.loglog(along, WEIGHT / along, **THEORY, label="m g / kp")
    label(
        axes,
        "stiffness kp (N/m)",
        "steady-state error (m)",
        "PD holds 1 kg below its target, the less the stiffer it is",
    )
    return figure


def draw_stability(bounds: Sequence[Bound]) -> "Figure":
    """Heights just below and just above each bound, and where all the runs were."""
    figure, (first, second, third) = make_panels(1, 3, (12.0, 4.2))
    for axes, bound in zip((first, second), bounds, strict=True):
        for response in (bound.above, bound.below):
            share = response.gains.stiffness / bound.theory
            axes.plot(response.times, response.height, ".-", label=f"kp {share:.3f} of the bound")
        axes.set_xlim(0.0, 0.3)
        axes.set_ylim(-1.0, 3.0)
        title = f"{bound.law}: theory {bound.theory:.0f} N/m, found {bound.found:.0f}"
        label(axes, "time (s)", "height (m)", title, legend="upper right")
    _draw_regions(third, bounds)
    return figure


def _draw_regions(axes: "Axes", bounds: Sequence[Bound]) -> None:
    """The plane of stiffness and damping without units, and where the runs were in it."""
    damping = np.geomspace(0.05, 10.0, 400)  # kd h / m
    explicit, implicit = 4.0 - 2.0 * damping, (4.0 + 2.0 * damping) / 3.0  # kp h^2 / m
    axes.plot(damping, explicit, "--", color="tab:blue", label="pd: kp h² + 2 kd h < 4 m")
    axes.plot(
        damping, implicit, "--", color="tab:orange", label="stable_pd: 3 kp h² < 4 m + 2 kd h"
    )
    axes.plot(damping, damping**2 / 4.0, ":", color="grey", label="critical damping")
    for bound, color in zip(bounds, ("tab:blue", "tab:orange"), strict=True):
        for response in bound.tried:
            gains, marker = response.gains, "o" if response.stable else "x"
            x, y = gains.damping * PERIOD / MASS, gains.stiffness * PERIOD**2 / MASS
            axes.plot(x, y, marker, color=color, fillstyle="none")
    axes.plot([], [], "o", color="black", fillstyle="none", label="run: stable")
    axes.plot([], [], "x", color="black", label="run: unstable")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(0.1, 10.0)
    label(axes, "damping kd h / m", "stiffness kp h² / m", "stable below the dashed lines")
