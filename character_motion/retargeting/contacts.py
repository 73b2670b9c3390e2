"""When feet and hands stand on the ground: near it and slow, with hysteresis."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray

_ENTER, _LEAVE = ((0.022, 0.20), (0.05, 0.10)), ((0.035, 0.40), (0.06, 0.15))
"""Heights in m below which, and speeds in m/s below which a point touches; either pair will do."""
_SMOOTHING_TIME = 0.05  # s over which a speed is measured
_MIN_CONTACT, _MAX_GAP = 0.06, 0.05  # s of a contact, and of a break that is none
_STILL_DISTANCE = 0.05  # m, the farthest that a point may be from its mean place during a contact
_SMOOTHED_PLACES = 0.08  # s over which places are averaged, so that noise goes
_GROUND = 2.0  # per cent of the heights of a joint that may be below its height on the ground


@dataclass(frozen=True)
class Contact:
    """A time in which a point of a body stands on the ground."""

    first: int  # frame
    last: int

    @property
    def frames(self) -> slice:
        """The frames of it."""
        return slice(self.first, self.last + 1)


def ground_height(heights: FloatArray) -> float:
    """The height of a joint that stands on the ground, of its heights (...) over a motion."""
    return float(np.percentile(heights, _GROUND))


def speeds(positions: FloatArray, frame_time: float) -> FloatArray:
    """Speed (f,) in m/s of points (f, 3), over a few hundredths of a second."""
    reach = max(1, round(0.5 * _SMOOTHING_TIME / frame_time))
    rows = np.arange(len(positions))
    after, before = np.minimum(rows + reach, len(rows) - 1), np.maximum(rows - reach, 0)
    lasting = np.maximum(after - before, 1) * frame_time
    speed: FloatArray = np.linalg.norm(positions[after] - positions[before], axis=-1) / lasting
    return speed


def find_contacts(positions: FloatArray, ground: float, frame_time: float) -> tuple[Contact, ...]:
    """The contacts of a point with the ground.

    Args:
        positions: Of the point (f, 3), in m of the character's size, z up.
        ground: Its height in m when it stands on the ground.
        frame_time: s.
    """
    positions = smoothed(positions, frame_time)
    height, speed = positions[:, 2] - ground, speeds(positions, frame_time)
    enters, stays = (
        np.any([(height < low) & (speed < slow) for low, slow in pairs], axis=0)
        for pairs in (_ENTER, _LEAVE)
    )
    found = joined(_with_hysteresis(enters, stays), frame_time)
    still = (_still_part(contact, positions) for contact in found)
    least = _least_frames(frame_time)
    return tuple(contact for contact in still if contact.last - contact.first + 1 >= least)


def smoothed(positions: FloatArray, frame_time: float) -> FloatArray:
    """Positions (f, 3) averaged over a few hundredths of a second, in which noise goes."""
    reach = round(0.5 * _SMOOTHED_PLACES / frame_time)
    padded = np.pad(positions, ((reach, reach), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0)
    average: FloatArray = windows.mean(axis=-1)
    return average


def _still_part(contact: Contact, positions: FloatArray) -> Contact:
    """The part of a contact in which a point stays where it is, and does not slide along."""
    first, last = contact.first, contact.last
    while last > first:
        places = positions[first : last + 1, :2]
        away = np.linalg.norm(places - places.mean(axis=0), axis=-1)
        if max(away[0], away[-1]) <= _STILL_DISTANCE:
            break
        if away[0] > away[-1]:
            first += 1
        else:
            last -= 1
    return Contact(first, last)


def joined(touches: BoolArray, frame_time: float) -> tuple[Contact, ...]:
    """The contacts of frames (f,) that touch; short breaks closed, and short contacts left out."""
    merged: list[tuple[int, int]] = []
    for first, last in ((first, end - 1) for first, end in spans(touches)):
        if merged and (first - merged[-1][1] - 1) * frame_time < _MAX_GAP:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    least = _least_frames(frame_time)
    return tuple(Contact(first, last) for first, last in merged if last - first + 1 >= least)


def spans(chosen: BoolArray) -> list[tuple[int, int]]:
    """The spans of frames (f,) that are chosen: the first frame of each, and the one after it."""
    edges = np.flatnonzero(np.diff(chosen.astype(int), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _least_frames(frame_time: float) -> int:
    return max(2, round(_MIN_CONTACT / frame_time))


def mask(contacts: tuple[Contact, ...], frames: int) -> BoolArray:
    """The frames (f,) of some contacts."""
    touches = np.zeros(frames, dtype=np.bool_)
    for contact in contacts:
        touches[contact.frames] = True
    return touches


def flat_frames(contacts: Mapping[str, tuple[Contact, ...]], side: str, frames: int) -> BoolArray:
    """The frames (f,) in which heel and toes of a side's foot stand on the ground."""
    return mask(contacts[f"{side}_heel"], frames) & mask(contacts[f"{side}_toe"], frames)


def _with_hysteresis(enters: BoolArray, stays: BoolArray) -> BoolArray:
    """The frames (f,) that lie in a span of frames that stay, of which one enters."""
    touches = np.zeros_like(stays)
    for first, end in spans(stays):
        if enters[first:end].any():
            touches[first:end] = True
    return touches
