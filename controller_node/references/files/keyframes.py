"""The YAML file of keyframes, checked key by key; its keyframes are counted from 1.

It has the keys `interpolation` (`smooth` or `linear`), `loop`, `period` (s) and `keyframes`, a list
of a `time` (s) and a `pose` each: degrees of freedom by name, in rad or m. What a pose leaves out
keeps its value of the keyframe before, at the first one that of the rest pose. With a `velocity`
(rad/s or m/s, of whole joints) a smooth path has this one there, else that of a parabola; with an
`acceleration` (rad/s² or m/s²) it has this one, else that of a cubic with the velocity.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from controller_node.references.limits import LARGEST_NUMBER, SHORTEST_TIME, JointLimits
from msgs_config import files
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character, Placement
from msgs_config.errors import LayoutError, MotionError, one_of
from msgs_config.geometry import rotations

_KEYS = ["interpolation", "loop", "period", "keyframes"]
_RATES = ("velocity", "acceleration")
_KEYFRAME_KEYS = ["time", "pose", *_RATES]
_MAX_SHOWN = 200  # characters


@dataclass(frozen=True)
class Keyframes:
    """The keyframes of a file, in a character's layout and where it stands."""

    times: FloatArray  # (p,) s, rising
    configurations: GeneralizedPosition  # (p, n), (p, k, 4)
    smooth: bool  # whether the path is a spline, not linear
    period: float | None = None  # s, of a loop
    velocities: FloatArray | None = None  # (p, n), a rotation's in the child frame; NaN: none
    accelerations: FloatArray | None = None  # (p, n), their rates of change; NaN: none


def read_keyframes(character: Character, path: str) -> Keyframes:
    """Read and check a file of keyframes; a root's are where the character stands.

    The path may be relative to the working directory, absolute, or `package://NAME/...`.

    Raises:
        MotionError: names the file, the keyframe, the value and what would be right.
    """
    file = files.resolve(path, Path.cwd(), MotionError)
    text = files.read_text(file, MotionError)
    content = files.parse_yaml_mapping(file, text, MotionError)
    _check_keys(f"{file}", content, _KEYS)
    interpolation = content.get("interpolation", "smooth")
    if interpolation not in ("smooth", "linear"):
        raise _wrong(f"{file}: interpolation", interpolation, "'smooth' or 'linear'")
    items = content.get("keyframes")
    if not isinstance(items, list) or not items:
        raise _wrong(f"{file}: keyframes", items, "a list of one keyframe or more")
    places = [f"{file}: keyframe {number}" for number in range(1, len(items) + 1)]
    for place, item in zip(places, items, strict=True):
        if not isinstance(item, dict):
            raise MotionError(f"{place} is {_shown(item)}; it must be a mapping with 'time'")
        _check_keys(place, item, _KEYFRAME_KEYS)
    times = _times(places, items)
    rates = [_rates(character, places, items, name) for name in _RATES]
    for name, rows in zip(_RATES, rates, strict=True):
        if rows is not None and interpolation != "smooth":
            raise MotionError(f"{file}: {name} is for 'interpolation: smooth'; remove it")
    return Keyframes(
        np.array(times),
        _configurations(character, _positions(character, places, items)),
        interpolation == "smooth",
        _period(file, content, times[-1]),
        *rates,
    )


def _times(places: list[str], items: list[dict[str, Any]]) -> list[float]:
    times: list[float] = []
    for place, item in zip(places, items, strict=True):
        time = _number(f"{place}: time", item.get("time"), minimum=0.0)
        if times and time - times[-1] < SHORTEST_TIME:
            right = f"later than the {times[-1]:g} s of the keyframe before"
            raise _wrong(f"{place}: time", time, right)
        times.append(time)
    return times


def _period(file: Path, content: dict[str, Any], last: float) -> float | None:
    """The period of a loop, None of what ends."""
    loops = content.get("loop", False)
    if not isinstance(loops, bool):
        raise _wrong(f"{file}: loop", loops, "true or false")
    if not loops:
        if "period" in content:
            raise MotionError(f"{file}: period is for a loop; add 'loop: true', or remove it")
        return None
    period = _number(f"{file}: period", content.get("period"), minimum=0.0)
    if period - last < SHORTEST_TIME:
        right = f"more than the last keyframe's time, {last:g} s"
        raise _wrong(f"{file}: period", period, right)
    return period


def _positions(character: Character, places: list[str], items: list[dict[str, Any]]) -> FloatArray:
    """The poses (p, n) of the file, message form."""
    limits, layout = JointLimits(character), character.layout
    index_of = {name: index for index, name in enumerate(layout.dof_names)}
    position, rows = _rest_in_own_world(character), []
    for place, item in zip(places, items, strict=True):
        pose = item.get("pose")
        pose = {} if pose is None else pose
        if not isinstance(pose, dict):
            raise _wrong(f"{place}: pose", pose, "a mapping of degrees of freedom")
        for name, value in pose.items():
            if name not in index_of:
                names = list(layout.dof_names)
                raise MotionError(f"{place}: pose: {_unknown('degree of freedom', name, names)}")
            position[index_of[name]] = _number(f"{place}: pose.{name}", value)
        _check_whole_rotations(place, layout, pose)
        excess = limits.excess(position)
        for name in pose:
            if excess[index_of[name]] > 0.0:
                right = f"within the joint's limits, {limits.text(index_of[name])}"
                raise _wrong(f"{place}: pose.{name}", pose[name], right)
        rows.append(position.copy())
    return np.array(rows)


def _check_whole_rotations(place: str, layout: JointLayout, pose: dict[str, Any]) -> None:
    """A rotation vector comes whole: what a component means depends on the two others."""
    for entries in layout.rotation_entries:
        names = [layout.dof_names[index] for index in entries]
        missing = [name for name in names if name not in pose]
        if missing and len(missing) < len(names):
            raise MotionError(
                f"{place}: pose: '{missing[0]}' is missing; {', '.join(names)} are one rotation "
                "vector and must come together"
            )


def _rates(
    character: Character, places: list[str], items: list[dict[str, Any]], key: str
) -> FloatArray | None:
    """Velocities, or accelerations, (p, n) of the file, NaN where it has none; None without any."""
    rows = np.full((len(items), character.layout.size), np.nan)
    for place, item, row in zip(places, items, rows, strict=True):
        rates = item.get(key)
        rates = {} if rates is None else rates
        if not isinstance(rates, dict):
            raise _wrong(f"{place}: {key}", rates, "a mapping of degrees of freedom")
        names = tuple(map(str, rates))
        try:
            entries = character.layout.indices(names)
        except LayoutError as error:
            raise MotionError(f"{place}: {key}: {error}") from error
        row[entries] = [_number(f"{place}: {key}.{name}", value) for name, value in rates.items()]
    if character.layout.has_floating_base:
        moving, still = rows[:, :3], np.array((0.0, 0.0, 0.0, 1.0))
        rows[:, :3] = replace(character.placement, x=0.0, y=0.0, z=0.0).moved(moving, still)[0]
    return rows if not np.isnan(rows).all() else None


def _rest_in_own_world(character: Character) -> FloatArray:
    """The rest pose (n,) as the character's own file has it, before it was placed."""
    rest, placement = np.array(character.rest_position), character.placement
    if character.layout.has_floating_base and placement != Placement():
        cosine, sine = math.cos(placement.yaw), math.sin(placement.yaw)
        undone = Placement(
            x=-cosine * placement.x - sine * placement.y,
            y=sine * placement.x - cosine * placement.y,
            z=-placement.z,
            yaw=-placement.yaw,
        )
        rest[:3], turn = undone.moved(rest[:3], rotations.exp(rest[3:6]))
        rest[3:6] = rotations.log(turn)
    return rest


def _configurations(character: Character, positions: FloatArray) -> GeneralizedPosition:
    """Poses (p, n) of the character's own world, in the world where it was placed."""
    placed = character.layout.configuration(positions)
    if character.layout.has_floating_base:
        root = character.placement.moved(positions[:, :3], placed.orientations_xyzw[:, 0])
        placed.position[:, :3], placed.orientations_xyzw[:, 0] = root
        placed.position[:, 3:6] = rotations.log(root[1])
    return placed


def _number(what: str, value: Any, minimum: float = -LARGEST_NUMBER) -> float:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if is_number and minimum <= value <= LARGEST_NUMBER:  # NaN is not within
        return float(value)
    raise _wrong(what, value, f"a number from {minimum:g} to {LARGEST_NUMBER:g}")


def _check_keys(place: str, content: dict[str, Any], known: list[str]) -> None:
    for key in content:
        if key not in known:
            raise MotionError(f"{place}: {_unknown('key', key, known)}")


def _unknown(what: str, name: object, known: list[str]) -> str:
    return one_of(what, name if isinstance(name, str) else _shown(name), known)


def _wrong(what: str, value: object, right: str) -> MotionError:
    if value is None:
        return MotionError(f"{what} is missing; it must be {right}")
    return MotionError(f"{what} is {_shown(value)}; it must be {right}")


def _shown(value: object) -> str:
    """A value as an error shows it: a few lines of YAML can stand for millions of entries."""
    if isinstance(value, (list, dict, tuple)):
        return f"a {type(value).__name__}"
    return repr(value)[:_MAX_SHOWN]
