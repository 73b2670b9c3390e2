"""The verdict on a run: a sentence on how it ended, and the metrics that support it."""

from collections.abc import Mapping
from typing import Any

_LIMP = "LIMP"  # the mode in which nothing drives the character
_TILES = (
    ("mean joint error", "joint_error_mean_rad", "rad"),
    ("mean slider error", "slider_error_mean_m", "m"),
    ("mean root error", "root_error_mean_m", "m"),
    ("largest root error", "root_error_max_m", "m"),
)


def describe_law(controller: Mapping[str, Any]) -> str | None:
    """The control law in a controller's parameters, with balance where it is on; None without."""
    law = controller.get("law")
    if law is None:
        return None
    return f"{law}, balance" if controller.get("balance.enabled") else str(law)


def describe_end(metrics: Mapping[str, object], law: str | None, *, has_reference: bool) -> str:
    """A sentence on how a run ended, by its metrics; see `falls`."""
    length, fell_at = f"{metrics['sim_time_s']:.4g} s", metrics["fell_at_s"]
    stood = "" if metrics["fell"] is None else " without a fall"
    if isinstance(fell_at, float):
        verdict = f"It fell at {fell_at:.3g} s of {length}"
        if metrics["fell_in_mode"] == _LIMP:
            verdict += ", limp, as its behaviour wants it"
    elif not has_reference:
        verdict = f"A run of {length} without a reference" + (stood and "," + stood)
    elif metrics["fell"] is not None and metrics["root_error_mean_m"] is None:
        verdict = f"It went on for {length}{stood}; its reference's root is where it was itself"
    else:
        verdict = f"It tracked its reference for {length}{stood}"
    return verdict + (f" (control law {law})." if law else ".")


def tiles(metrics: Mapping[str, object]) -> list[tuple[str, str]]:
    """Name and value of the metrics that support the verdict, as far as they were measured."""
    known = {name: value for name, value in metrics.items() if isinstance(value, float)}
    shown = [(title, f"{known[key]:.3g} {unit}") for title, key, unit in _TILES if key in known]
    force, weight = known.get("assist_force_mean_n"), known.get("body_weight_n", 0.0)
    if force is not None and weight > 0.0:
        shown.append(("mean root force / weight", f"{force / weight:.3g}"))
    if "saturated_fraction" in known:
        shown.append(("at effort limits", f"{100.0 * known['saturated_fraction']:.3g} %"))
    return shown
