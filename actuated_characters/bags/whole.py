"""A fork's recording with its past: one that begins in a keyframe has only what comes after it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.bags.forked_from import KEY, ForkedFrom, read_forked_from
from actuated_characters.bags.format.metadata import read_metadata
from actuated_characters.bags.recording import Recording, find_bag, read_recordings
from msgs_config.errors import ActuatedCharactersError

_ROWS = (  # of a state each
    *("stamps_ns", "published_ns", "position", "velocity", "commands"),
    *("reference_position", "reference_velocity"),
)
_ITEMS = (  # of what there may be none at all: the name, one of nothing, and how many beside ticks
    ("contacts", None, 0),
    ("applied_wrench", None, 0),
    ("throws", (), 0),
    ("balls", None, 1),
    ("pins", None, 1),
)


def read_whole(path: Path) -> tuple[Recording, ...]:
    """Read a bag; what a fork was recorded without comes from the runs that it was forked from.

    Where one of these is not there any more, or another one has taken its place, the recording
    begins after it. Raises as `read_recordings`.
    """
    recordings = read_recordings(path)
    seen = {find_bag(path)}
    while len(recordings) == 1 and recordings[0].keyframe is not None:
        origin = _origin(find_bag(path))
        if origin is None:
            break
        try:
            path = Path(origin.path)
            bag, past = find_bag(path), read_recordings(path)
        except ActuatedCharactersError:
            break
        row = _common_row(past, recordings[0])
        if bag in seen or row is None:
            break
        seen.add(bag)
        recordings = (joined(past[0], row, recordings[0]),)
    return recordings


def _origin(bag: Path) -> ForkedFrom | None:
    """The run that a bag's own was forked from; None of any other."""
    custom = read_metadata(bag).content.get("custom_data") if bag.is_dir() else None
    return read_forked_from(custom.get(KEY)) if isinstance(custom, dict) else None


def _common_row(past: tuple[Recording, ...], later: Recording) -> int | None:
    """The row in which a recording has another's first state, to the bit; None if there is none."""
    if len(past) != 1 or past[0].layout.dof_names != later.layout.dof_names:
        return None
    before = past[0]
    rows = np.flatnonzero(before.stamps_ns == later.stamps_ns[0])
    for row in rows.tolist():
        if all(
            getattr(before, name)[row].tobytes() == getattr(later, name)[0].tobytes()
            for name in ("position", "velocity")
        ):
            return int(row)
    return None


def joined(before: Recording, row: int, after: Recording) -> Recording:
    """A recording up to the state of a row, and another one from that state on."""
    first_ns = int(after.stamps_ns[0])
    changed: dict[str, Any] = {
        name: _appended(getattr(before, name)[:row], getattr(after, name)) for name in _ROWS
    }
    changed["effort"] = np.concatenate([before.effort[:row], after.effort])
    for name, nothing, more in _ITEMS:
        whole, other = getattr(before, name), getattr(after, name)
        if whole or other:
            whole = whole or (nothing,) * (len(before.effort) + more)
            other = other or (nothing,) * (len(after.effort) + more)
            changed[name] = (*whole[:row], *other)
    for name in ("modes", "plans"):
        earlier = [each for each in getattr(before, name) if each.stamp_ns < first_ns]
        later = [each for each in getattr(after, name) if each.stamp_ns >= first_ns]
        changed[name] = (*earlier, *later)
    for name in ("parameters", "begins_amid", "keyframe", "controller_keyframe"):
        changed[name] = getattr(before, name)
    return replace(after, **changed)


def _appended(before: Any, after: Any) -> Any:
    """Two arrays, or two tuples, one behind the other."""
    if isinstance(after, np.ndarray):
        return np.concatenate([before, after])
    return (*before, *after)
