"""Looks at what a run has left, with eyes of its own: heights, tilts, ways, and flights.

Nothing here asks the verdict that it is to judge: it reads the states in the bag, and what touches.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import read_recordings
from msgs_config.errors import ActuatedCharactersError
from msgs_config.geometry import rotations
from tests.documented.promise import Promise

_END = 0.25  # s before the end, over which height and tilt are means


@dataclass(frozen=True)
class Seen:
    """What a run's states and its summary show; None where they show nothing of the kind."""

    height: float | None = None  # m
    tilt: float | None = None  # rad
    travelled: float | None = None  # m
    airborne: float | None = None  # s
    fell: bool | None = None
    error: float | None = None  # rad
    state_hash: str = ""

    def describe(self) -> str:
        """The figures in a line."""
        parts = {
            "height": self.height and f"{self.height:.2f} m",
            "tilt": self.tilt is not None and f"{self.tilt:.2f} rad",
            "way": self.travelled is not None and f"{self.travelled:.1f} m",
            "in the air": self.airborne and f"{self.airborne:.2f} s",
            "fell": None if self.fell is None else str(self.fell).lower(),
            "joint error": self.error is not None and f"{self.error:.3f} rad",
        }
        return ", ".join(f"{name} {text}" for name, text in parts.items() if text)


def look_at(folder: Path) -> Seen:
    """What the first character of a run shows, as far as there is anything."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except OSError:
        return Seen()
    of_summary = {
        "fell": summary["fell"],
        "error": summary["joint_error_mean_rad"],
        "state_hash": summary["state_hash"],
    }
    try:
        recording = read_recordings(folder)[0]
    except ActuatedCharactersError:
        return Seen(**of_summary)
    if not recording.layout.has_floating_base:
        return Seen(**of_summary)
    last = recording.times >= recording.times[-1] - _END
    rest = rotations.exp(np.array(recording.character.rest_position[3:6]))
    up = rotations.rotate(rotations.conjugate(rest), np.array((0.0, 0.0, 1.0)))
    axes = rotations.rotate(rotations.exp(recording.position[last, 3:6]), up)
    way = recording.position[-1, :2] - recording.position[0, :2]
    contacts = recording.contacts[1:]  # in the first tick it is put down
    touching = [wrenches is not None and len(wrenches.links) > 0 for wrenches in contacts]
    free = np.diff(np.flatnonzero([True, *touching, True])) - 1
    return Seen(
        height=float(recording.position[last, 2].mean()),
        tilt=float(np.arccos(np.clip(axes[:, 2], -1.0, 1.0)).mean()),
        travelled=float(np.linalg.norm(way)),
        airborne=float(free.max()) / float(recording.parameters["rate"]) if touching else None,
        **of_summary,
    )


def broken(promise: Promise, seen: Seen, other: Seen | None) -> list[str]:
    """What of a promise was not kept."""
    found = []
    for name, value in (("height", seen.height), ("travels", seen.travelled)):
        bounds = getattr(promise, name)
        if bounds is not None and not (value is not None and bounds[0] <= value <= bounds[1]):
            found.append(f"{name} is {value}, not within {bounds[0]:g} to {bounds[1]:g} m")
    for name in ("tilt", "error"):
        most, value = getattr(promise, name), getattr(seen, name)
        if most is not None and not (value is not None and value <= most):
            found.append(f"{name} is {value}, more than {most:g} rad")
    if promise.airborne is not None and not (seen.airborne or 0.0) >= promise.airborne:
        found.append(f"it was in the air for {seen.airborne} s, less than {promise.airborne:g}")
    if promise.fell is not None and seen.fell is not promise.fell:
        found.append(f"fell is {seen.fell}")
    if other is not None and seen.state_hash != other.state_hash:
        found.append(f"its states are not those of {promise.same_as}")
    return found
