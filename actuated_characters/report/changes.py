"""Parameters of a recording: those in force, changes while it ran, and differences of two runs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from actuated_characters.bags.recording import NodeParameters, Recording
from msgs_config.character.layout import ROOT
from msgs_config.character.model import ROOT_TORQUE
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

_MOST_SHOWN = 3  # numbers of a list that are shown


@dataclass(frozen=True)
class Change:
    """A node's parameter that was changed while it ran."""

    time: float  # s since the first state, of the last state with the old value
    name: str
    before: object
    after: object

    @property
    def line(self) -> str:
        """The change in words."""
        return f"{self.name}: {_shortened(self.before)} to {_shortened(self.after)}"


def _shortened(value: object) -> str:
    """A value, a long list by its first entries."""
    if isinstance(value, list) and len(value) > _MOST_SHOWN:
        first = ", ".join(f"{each:.4g}" for each in value[:_MOST_SHOWN])
        return f"[{first}, ... {len(value)} in all]"
    return str(value)


@dataclass(frozen=True)
class GainsInForce:
    """A controller's gains of one joint; None where they were not recorded."""

    joint: str
    p: float | None  # N m/rad or N/m
    d: float | None  # N m s/rad or N s/m
    i: float | None  # N m/(rad s) or N/(m s)
    limit: float | None  # N m or N; infinite: none


def live_changes(recording: Recording) -> list[Change]:
    """The nodes' parameters that were changed in the course of a recording, in their order."""
    start = int(recording.stamps_ns[0])
    both = [_changes(settings, start) for settings in (recording.simulator, recording.controller)]
    return sorted((*both[0], *both[1]), key=lambda change: change.time)


def _changes(settings: Sequence[NodeParameters], start: int) -> list[Change]:
    changes: list[Change] = []
    for earlier, later in pairwise(settings):
        # Without a stamp it is another controller, or the same one restarted.
        after = start if later.after_stamp_ns is None else later.after_stamp_ns
        for name, values in differences(earlier.parameters, later.parameters).items():
            changes.append(Change((after - start) / NANOSECONDS_PER_SECOND, name, *values))
    return changes


def differences(
    first: Mapping[str, Any], second: Mapping[str, Any]
) -> dict[str, tuple[object, object]]:
    """Both values of each parameter that differs; None for one that is not there."""
    return {
        name: (first.get(name), second.get(name))
        for name in sorted(first.keys() | second.keys())
        if first.get(name) != second.get(name) or (name in first) != (name in second)
    }


def law(parameters: Mapping[str, Any]) -> str | None:
    """The control law by its name, with balance where it is enabled; None if there is none."""
    found = parameters.get("law")
    if found is None:
        return None
    return f"{found}, balance" if parameters.get("balance.enabled") else str(found)


def gains(parameters: Mapping[str, Any], names: Sequence[str]) -> list[GainsInForce]:
    """Gains and limits of the vectors of these names, times the parameters that scale them."""
    assists = float(bool(parameters.get("root_assistance", True)))
    rows = []
    for name in names:
        scaled: dict[str, float | None] = {}
        for kind in ("p", "d", "i"):
            value = number(parameters.get(f"gains.{name}.{kind}"))
            scale = number(parameters.get(f"gain_scale.{kind}", 1.0)) or 0.0
            factor = assists if name in (ROOT, ROOT_TORQUE) else scale
            scaled[kind] = None if value is None else factor * value
        limit = parameters.get(f"effort_limit.{name}", "unknown")
        scaled["limit"] = math.inf if limit is None else number(limit)  # JSON has no infinity
        rows.append(GainsInForce(name, **scaled))
    return rows


def number(value: object) -> float | None:
    """A number of a message from any node; None if it is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        return float(value)
    except OverflowError:
        return None
