"""The verdict on a run: a sentence on how it ended, and the metrics that support it."""

from collections.abc import Mapping

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import fall_time
from actuated_characters.report.facts import RunFacts

_TILES = (
    ("mean joint error", "joint_error_mean_rad", "rad"),
    ("mean slider error", "slider_error_mean_m", "m"),
    ("mean root error", "root_error_mean_m", "m"),
    ("largest root error", "root_error_max_m", "m"),
)


def describe_end(recording: Recording, facts: RunFacts, metrics: Mapping[str, object]) -> str:
    """A sentence on how a run ended."""
    length = f"{recording.times[-1]:.4g} s"
    if not facts.reference:
        verdict = f"A run of {length} without a reference"
    elif metrics["fell"]:
        height, desired = recording.position[:, 2], recording.reference_position[:, 2]
        verdict = f"It fell at {fall_time(recording.times, height, desired):.3g} s of {length}"
    elif metrics["fell"] is not None:
        verdict = f"It tracked its reference for {length} without a fall"
    else:
        verdict = f"It tracked its reference for {length}"
    return verdict + (f" (control law {facts.law})." if facts.law else ".")


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
