"""Clips cut, repeated, joined and played at other speeds."""

import math
from dataclasses import replace

import numpy as np

from character_motion.clips.motion_clip import MotionClip, Spans
from character_motion.retargeting.skeleton_map import other_side
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.errors import ClipError
from msgs_config.geometry import fixed_order, rotations

_MIN_CYCLE = 0.2  # s that a cycle lasts at least
_COMPARED_SECONDS = 0.1  # s over which two moments are compared
_SPEEDS = (0.05, 20.0)
_EPSILON = 1e-9  # s


def trim(clip: MotionClip, start: float, end: float | None = None) -> MotionClip:
    """The frames from a time in s to another one; it then ends where it is cut.

    Raises:
        ClipError: a time is outside of the clip, or there are fewer than two frames between.
    """
    end = clip.duration if end is None else end
    rows = np.flatnonzero((clip.times >= start - _EPSILON) & (clip.times <= end + _EPSILON))
    if len(rows) < 2:
        raise ClipError(
            f"from {start:g} s to {end:g} s there are {len(rows)} frames of a clip of "
            f"{clip.duration:g} s; there must be two or more"
        )
    _check_times(clip, start, end)
    how = f"trimmed to {start:g} s to {end:g} s"
    return _part(clip, int(rows[0]), int(rows[-1]), how)


def change_speed(clip: MotionClip, factor: float) -> MotionClip:
    """The clip played faster by a factor.

    Raises:
        ClipError: the factor is out of range.
    """
    if not _SPEEDS[0] <= factor <= _SPEEDS[1]:
        raise ClipError(f"speed {factor:g}; it must be {_SPEEDS[0]:g} to {_SPEEDS[1]:g}")
    contacts = {
        point: tuple((start / factor, end / factor) for start, end in spans)
        for point, spans in clip.contacts.items()
    }
    return clip.edited(f"speed {factor:g}", times=clip.times / factor, contacts=contacts)


def loop(clip: MotionClip, start: float | None = None, end: float | None = None) -> MotionClip:
    """A cycle of the clip that goes on from its end, the gap between its ends closed evenly.

    Where a time is not given, it is that of the two moments which are most alike in pose and
    speed, at least a fifth of a second and a third of the clip apart.

    Raises:
        ClipError: a time is outside of the clip, or the clip is too short.
    """
    _check_times(clip, start, end)
    first, last = _cycle(clip, start, end)
    part = _part(
        clip, first, last, f"cycle from {clip.times[first]:.3f} s to {clip.times[last]:.3f} s"
    )
    layout, moves = clip.character.layout, clip.character.layout.has_floating_base
    begin, finish = _row(part.motion, 0), _row(part.motion, -1)
    if moves:  # over the ground, and about z, a cycle goes on from where it ended
        begin = _turned(begin, _yaw_between(begin, finish))
    gap = layout.difference(finish, begin)
    if moves:
        gap[:2] = 0.0
    share = (part.times / part.duration)[:, np.newaxis]
    smooth = share * share * (3.0 - 2.0 * share) - 0.5
    return replace(part, motion=_moved(part, smooth * gap), wraps=True)


def blend(first: MotionClip, second: MotionClip, duration: float) -> MotionClip:
    """The first clip, and the second one from its end on, faded into each other over a time in s.

    The second one is moved and turned along the ground to where the first one is. Frames come at
    the rate of the first.

    Raises:
        ClipError: a clip is shorter than that time.
    """
    shortest = min(first.duration, second.duration)
    if not 0.0 < duration <= shortest:
        raise ClipError(
            f"blended over {duration:g} s; it must be over 0 and at most {shortest:g} s, which the "
            "shorter clip lasts"
        )
    begins = first.duration - duration
    step = 1.0 / first.rate
    count = math.floor((begins + second.duration) / step + 1e-6) + 1
    times: FloatArray = step * np.arange(count, dtype=float)
    one = _samples(first, np.minimum(times, first.duration))
    two = _samples(second, np.maximum(times - begins, 0.0))
    join = int(np.searchsorted(times, begins + 0.5 * duration).clip(0, count - 1))
    if first.character.layout.has_floating_base:
        two = _carried(two, _row(two, join), _row(one, join))
    share = np.clip((times - begins) / duration, 0.0, 1.0)
    weight = (share * share * (3.0 - 2.0 * share))[:, np.newaxis]
    way = weight * first.character.layout.difference(one, two)
    contacts = {
        point: _joined(first, second, point, begins, duration)
        for point in {**first.contacts, **second.contacts}
    }
    licences = [each.source["licence"] for each in (first, second) if "licence" in each.source]
    source = dict(first.source)
    if licences:
        source["licence"] = "; ".join(dict.fromkeys(map(str, licences)))
    made = replace(first, motion=one, times=times, contacts=contacts, wraps=False, source=source)
    name = second.source.get("file", second.source.get("clip", "another clip"))
    return replace(made, motion=_moved(made, way)).edited(
        f"{name} after it, blended {duration:g} s"
    )


def mirror(clip: MotionClip) -> MotionClip:
    """The clip with left and right exchanged.

    Raises:
        ClipError: the character is not the same on both sides, or a joint has no counterpart.
    """
    from character_motion.clips.mirroring import mirrored_motion

    contacts = {other_side(point): spans for point, spans in clip.contacts.items()}
    return clip.edited("mirrored", motion=mirrored_motion(clip), contacts=contacts)


def _check_times(clip: MotionClip, start: float | None, end: float | None) -> None:
    """Raise ClipError if a time in s is not within a clip."""
    latest = clip.duration + 0.5 / clip.rate  # a duration that was rounded for display will do
    for time in (start, end):
        if time is not None and not -_EPSILON <= time <= latest:
            goes_on = ", and begins again there" if clip.wraps else ""
            raise ClipError(
                f"{time:g} s is not within the clip, which lasts {clip.duration:.3f} s{goes_on}"
            )


def _part(clip: MotionClip, first: int, last: int, how: str) -> MotionClip:
    rows = slice(first, last + 1)
    start, end = float(clip.times[first]), float(clip.times[last])
    contacts = {point: _within(spans, start, end) for point, spans in clip.contacts.items()}
    motion = GeneralizedPosition(clip.motion.position[rows], clip.motion.orientations_xyzw[rows])
    times = clip.times[rows] - start
    return clip.edited(how, times=times, motion=motion, contacts=contacts, wraps=False)


def _within(spans: Spans, start: float, end: float) -> Spans:
    """The parts of spans that lie between two times, which are then counted from the first."""
    parts = ((max(a, start) - start, min(b, end) - start) for a, b in spans)
    return tuple((a, b) for a, b in parts if b > a)


def _joined(
    first: MotionClip, second: MotionClip, point: str, begins: float, duration: float
) -> Spans:
    """The contacts of a point, of each clip until or from the middle of the blend on."""
    middle = begins + 0.5 * duration
    before = _within(first.contacts.get(point, ()), 0.0, middle)
    offset = middle - begins
    after = _within(second.contacts.get(point, ()), offset, second.duration)
    return (*before, *((a + middle, b + middle) for a, b in after))


def _cycle(clip: MotionClip, start: float | None, end: float | None) -> tuple[int, int]:
    """The first and the last frame of a cycle."""
    rows = np.arange(len(clip.times))
    firsts = rows if start is None else rows[[int(np.argmin(np.abs(clip.times - start)))]]
    lasts = rows if end is None else rows[[int(np.argmin(np.abs(clip.times - end)))]]
    least = _MIN_CYCLE if start is not None else max(_MIN_CYCLE, clip.duration / 3.0)
    features = _features(clip)
    best, found = np.inf, None
    for first in firsts.tolist():
        allowed = lasts[clip.times[lasts] - clip.times[first] >= least - _EPSILON]
        if len(allowed):
            distances = np.square(features[allowed] - features[first]).sum(axis=1)
            nearest = int(np.argmin(distances))
            if distances[nearest] < best:
                best, found = float(distances[nearest]), (first, int(allowed[nearest]))
    if found is None:
        raise ClipError(
            f"no cycle of {least:.3g} s or more in a clip of {clip.duration:g} s; give other times"
        )
    return found


def _features(clip: MotionClip) -> FloatArray:
    """What two moments have in common that are alike (f, m): pose and velocity, without place."""
    layout = clip.character.layout
    now = clip.motion
    ahead = _samples(clip, np.minimum(clip.times + _COMPARED_SECONDS, clip.duration))
    turns = now.orientations_xyzw.copy()
    velocity = layout.difference(now, ahead)
    positions = now.position.copy()
    if layout.has_floating_base:
        headings = rotations.yaw(turns[:, 0])
        back = np.stack([rotations.about_z(-float(heading)) for heading in headings])
        turns[:, 0] = rotations.multiply(back, turns[:, 0])
        velocity[:, :3] = rotations.rotate(back, velocity[:, :3])
        positions[:, :2] = 0.0
    positions[:, layout.rotation_entries] = rotations.log(turns)
    return np.concatenate((positions, velocity), axis=1)


def _samples(clip: MotionClip, times: FloatArray) -> GeneralizedPosition:
    """The motion at some times (f,) in s: between frames every velocity is constant."""
    motion, last = clip.motion, len(clip.times) - 1
    frames = np.searchsorted(clip.times, times, side="right").clip(1, last) - 1
    share = (times - clip.times[frames]) / (clip.times[frames + 1] - clip.times[frames])
    share = share.clip(0.0, 1.0)[:, np.newaxis]
    before, after = motion.position[frames], motion.position[frames + 1]
    positions = before + share * (after - before)
    start = motion.orientations_xyzw[frames]
    turn = rotations.multiply(rotations.conjugate(start), motion.orientations_xyzw[frames + 1])
    part = rotations.exp(share[:, :, np.newaxis] * rotations.log(turn))
    turns = rotations.multiply(start, part)
    positions[:, clip.character.layout.rotation_entries] = rotations.log(turns)
    return GeneralizedPosition(positions, turns)


def _moved(clip: MotionClip, way: FloatArray) -> GeneralizedPosition:
    """The motion moved by a way (f, n) in each frame; a rotation's part is in its child frame."""
    entries = clip.character.layout.rotation_entries
    turned = rotations.multiply(clip.motion.orientations_xyzw, rotations.exp(way[:, entries]))
    positions = np.clip(clip.motion.position + way, *clip.character.position_bounds())
    positions[:, entries] = rotations.log(turned)
    return GeneralizedPosition(positions, turned)


def _row(motion: GeneralizedPosition, row: int) -> GeneralizedPosition:
    return GeneralizedPosition(motion.position[row].copy(), motion.orientations_xyzw[row].copy())


def _yaw_between(start: GeneralizedPosition, end: GeneralizedPosition) -> FloatArray:
    """The turn (4,) about z from one root to another."""
    turn = rotations.multiply(
        end.orientations_xyzw[0], rotations.conjugate(start.orientations_xyzw[0])
    )
    return rotations.about_z(float(rotations.yaw(turn)))


def _turned(pose: GeneralizedPosition, turn_xyzw: FloatArray) -> GeneralizedPosition:
    turns = pose.orientations_xyzw.copy()
    turns[0] = rotations.multiply(turn_xyzw, turns[0])
    return GeneralizedPosition(pose.position, turns)


def _carried(
    motion: GeneralizedPosition, here: GeneralizedPosition, there: GeneralizedPosition
) -> GeneralizedPosition:
    """A motion moved and turned along the ground so that its pose here is over that one there."""
    turn = _yaw_between(here, there)
    positions, turns = motion.position.copy(), motion.orientations_xyzw.copy()
    from_here = positions[:, :3] - here.position[:3] * np.array((1.0, 1.0, 0.0))
    positions[:, :3] = fixed_order.apply(rotations.matrix(turn), from_here)
    positions[:, :2] += there.position[:2]
    turns[:, 0] = rotations.multiply(turn, turns[:, 0])
    return GeneralizedPosition(positions, turns)
