"""Parameters: what was in force, what was changed meanwhile, and how two runs' differ."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from actuated_characters.bags.recording import Recording
from msgs_config.character.layout import ROOT
from msgs_config.character.model import ROOT_TORQUE
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

_KINDS = ("p", "d", "i")
_ABSENT = object()


@dataclass(frozen=True)
class Change:
    """A controller's parameter that was changed while it ran."""

    time: float  # s since the first state, of the last state that the old value answered
    name: str
    before: object
    after: object


@dataclass(frozen=True)
class GainsInForce:
    """What a controller drives one joint by; None where it said nothing."""

    joint: str
    p: float | None  # N m/rad or N/m
    d: float | None  # N m s/rad or N s/m
    i: float | None  # N m/(rad s) or N/(m s)
    limit: float | None  # N m or N; infinite: none


def live_changes(recording: Recording) -> list[Change]:
    """The controllers' parameters that were changed in the course of a recording."""
    changes: list[Change] = []
    for earlier, later in zip(recording.controller, recording.controller[1:], strict=False):
        after = later.after_stamp_ns
        if after is None:  # another controller, or the same one restarted
            after = int(recording.stamps_ns[0])
        time = (after - int(recording.stamps_ns[0])) / NANOSECONDS_PER_SECOND
        for name, values in differences(earlier.parameters, later.parameters).items():
            changes.append(Change(time, name, *values))
    return changes


def differences(
    first: Mapping[str, Any], second: Mapping[str, Any]
) -> dict[str, tuple[object, object]]:
    """Both values of each parameter that is not the same; None where one does not know it."""
    names = sorted(first.keys() | second.keys())
    return {
        name: (first.get(name), second.get(name))
        for name in names
        if first.get(name) != second.get(name) or (name in first) != (name in second)
    }


def law(parameters: Mapping[str, Any]) -> str | None:
    """The control law by its name, with what is added to it."""
    found = parameters.get("law")
    if found is None:
        return None
    return f"{found}, balance" if parameters.get("balance.enabled") else str(found)


def gains(parameters: Mapping[str, Any], names: Sequence[str]) -> list[GainsInForce]:
    """Gains and limits of the vectors of these names, with the scales counted in."""
    assists = float(bool(parameters.get("root_assistance", True)))
    rows = []
    for name in names:
        scaled: dict[str, float | None] = {}
        for kind in _KINDS:
            value = number(parameters.get(f"gains.{name}.{kind}"))
            scale = number(parameters.get(f"gain_scale.{kind}", 1.0)) or 0.0
            factor = assists if name in (ROOT, ROOT_TORQUE) else scale
            scaled[kind] = None if value is None else factor * value
        limit = parameters.get(f"effort_limit.{name}", _ABSENT)
        scaled["limit"] = math.inf if limit is None else number(limit)  # JSON has no infinity
        rows.append(GainsInForce(name, **scaled))
    return rows


def number(value: object) -> float | None:
    """A number of a message that anybody may have written; None if it is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        return float(value)
    except OverflowError:
        return None
