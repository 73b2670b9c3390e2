"""Edits of a timeline: each makes another content, and changes none.

Layers, poses and events are meant by their numbers, from 0, in the order of the content; poses of a
layer and events of a track are kept in the order of their times.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from actuated_characters.timeline.content import KEYS, RATES, TRACKS, Content, is_number
from msgs_config.errors import MotionError, one_of

Edit: TypeAlias = Callable[[Content], Content]

SHORTEST_TIME = 1e-3  # s between two poses of a layer
_DECIMALS = 6  # of times in s, and of values in rad and m
_FIRST_LAYER: dict[str, Any] = {"name": "body", "in": 0.3, "out": "never", "poses": []}


def rounded(value: float) -> float:
    """A time or value as a file has it: a micrometre, a microsecond, or as small a turn."""
    return round(float(value), _DECIMALS) + 0.0  # no negative zero


def add_layer(name: str, **settings: Any) -> Edit:
    """Add a layer without poses above all others, with settings such as `in` and `out`."""

    def edit(content: Content) -> Content:
        layer = {"name": name, **settings, "poses": []}
        return {**content, KEYS: [*content.get(KEYS, []), layer]}

    return edit


def delete_layer(layer: int) -> Edit:
    """Remove a layer with its poses."""

    def edit(content: Content) -> Content:
        _item(content, KEYS, layer)
        return _with_list(content, KEYS, _without(content[KEYS], layer))

    return edit


def set_layer(layer: int, name: str, value: Any) -> Edit:
    """Set a value of a layer, such as `out`; None removes it."""

    def edit(content: Content) -> Content:
        changed = _with_value(_item(content, KEYS, layer), name, value)
        return _with_item(content, KEYS, layer, changed)

    return edit


def add_pose(
    layer: int,
    at: float,
    pose: Mapping[str, float],
    ease: str | None = None,
    velocity: Mapping[str, float] | None = None,
    acceleration: Mapping[str, float] | None = None,
) -> Edit:
    """Add a pose (degrees of freedom by name, rad or m) to a layer at a time in s.

    One that is there at this time is replaced, but for its ease, its velocity (rad/s or m/s) and
    its acceleration (rad/s² or m/s²), where none is given. Layer 0 is made where there is none.
    """

    def edit(content: Content) -> Content:
        if layer == 0 and not content.get(KEYS):
            content = {**content, KEYS: [_FIRST_LAYER]}
        poses = list(_item(content, KEYS, layer)["poses"])
        time, found = _time(at), _row_at(poses, at)
        before = {"at": time} if found is None else poses.pop(found)
        added = _with_rates({**before, "pose": _all_rounded(pose)}, velocity, acceleration)
        added = added if ease is None else _eased(added, ease)
        return _with_poses(content, layer, [*poses, added])

    return edit


def move_pose(layer: int, number: int, at: float) -> Edit:
    """Move a pose to another time in s. Raises MotionError where there is one already."""

    def edit(content: Content) -> Content:
        poses = list(_item(content, KEYS, layer)["poses"])
        moved = {**_pose(content, layer, number), "at": _time(at)}
        del poses[number]
        _check_free(poses, at)
        return _with_poses(content, layer, [*poses, moved])

    return edit


def copy_pose(layer: int, number: int, at: float) -> Edit:
    """Add a pose once more, at another time in s. Raises MotionError where there is one."""

    def edit(content: Content) -> Content:
        copied = {**_pose(content, layer, number), "at": _time(at)}
        poses = list(content[KEYS][layer]["poses"])
        _check_free(poses, at)
        return _with_poses(content, layer, [*poses, copied])

    return edit


def delete_pose(layer: int, number: int) -> Edit:
    """Remove a pose."""

    def edit(content: Content) -> Content:
        _pose(content, layer, number)
        return _with_poses(content, layer, _without(content[KEYS][layer]["poses"], number))

    return edit


def set_pose(
    layer: int,
    number: int,
    pose: Mapping[str, float],
    velocity: Mapping[str, float] | None = None,
    acceleration: Mapping[str, float] | None = None,
) -> Edit:
    """Replace what a pose says (rad or m), such as by its mirror image; None keeps a rate."""

    def edit(content: Content) -> Content:
        replaced = {**_pose(content, layer, number), "pose": _all_rounded(pose)}
        changed = _with_rates(replaced, velocity, acceleration)
        return _with_poses(content, layer, _with(content[KEYS][layer]["poses"], number, changed))

    return edit


def set_pose_value(layer: int, number: int, name: str, value: float) -> Edit:
    """Set one degree of freedom of a pose, rad or m."""

    def edit(content: Content) -> Content:
        values = {**_pose(content, layer, number)["pose"], name: value}
        return set_pose(layer, number, values)(content)

    return edit


def set_ease(layer: int, number: int, ease: str) -> Edit:
    """Set how a pose is moved through: `smooth` or `rest`, which has no rates."""

    def edit(content: Content) -> Content:
        changed = _eased(_pose(content, layer, number), ease)
        return _with_poses(content, layer, _with(content[KEYS][layer]["poses"], number, changed))

    return edit


def add_event(track: str, event: Mapping[str, Any]) -> Edit:
    """Add an event to a track; its `at` is a time in s."""

    def edit(content: Content) -> Content:
        _check_track(track)
        added = {**event, "at": _time(event.get("at"))}
        return _with_list(content, track, _in_order([*content.get(track, []), added]))

    return edit


def event_at(event: Mapping[str, Any], at: float) -> dict[str, Any]:
    """An event at another time in s; its end moves along."""
    moved = {**event, "at": _time(at)}
    if is_number(event.get("until")):
        moved["until"] = rounded(event["until"] + _time(at) - event["at"])
    return moved


def event_until(event: Mapping[str, Any], end: float) -> dict[str, Any]:
    """An event that ends at another time in s; of a clip, which has none, that is where it is cut.

    Raises:
        MotionError: it would end before it begins.
    """
    lasts = rounded(_time(end) - event["at"])
    if lasts < SHORTEST_TIME:
        raise MotionError(f"it begins at {event['at']:g} s, and must end later than that")
    if "clip" not in event:
        return {**event, "until": _time(end)}
    begin = event["from"] if is_number(event.get("from")) else 0.0
    return {**event, "to": rounded(begin + lasts)}


def replace_event(track: str, number: int, event: Mapping[str, Any]) -> Edit:
    """Have another event in the place of one."""

    def edit(content: Content) -> Content:
        _item(content, track, number)
        return _with_list(content, track, _in_order(_with(content[track], number, dict(event))))

    return edit


def delete_event(track: str, number: int) -> Edit:
    """Remove an event."""

    def edit(content: Content) -> Content:
        _item(content, track, number)
        return _with_list(content, track, _without(content[track], number))

    return edit


def set_event(track: str, number: int, name: str, value: Any) -> Edit:
    """Set a value of an event; None removes it."""

    def edit(content: Content) -> Content:
        changed = _with_value(_item(content, track, number), name, value)
        changed = {**changed, "at": _time(changed.get("at"))}
        return _with_list(content, track, _in_order(_with(content[track], number, changed)))

    return edit


def set_value(name: str, value: Any) -> Edit:
    """Set a value of the whole timeline, such as `duration`; None removes it."""

    def edit(content: Content) -> Content:
        return _with_value(content, name, value)

    return edit


def _time(at: object) -> float:
    if not is_number(at) or at < 0.0:
        raise MotionError(f"at is {at!r}; it must be a time in s, 0 or more")
    return rounded(at)


def _all_rounded(values: Mapping[str, float]) -> dict[str, float]:
    return {name: rounded(value) for name, value in values.items()}


def _with_rates(pose: Mapping[str, Any], *rates: Mapping[str, float] | None) -> Mapping[str, Any]:
    """A pose with other `RATES`, without one that is empty; None is the one that it has."""
    for name, values in zip(RATES, rates, strict=True):
        if values is None:
            continue
        pose = _with_value(pose, name, _all_rounded(values) or None)
        if values and pose.get("ease") == "rest":
            pose = _with_value(pose, "ease", None)
    return pose


def _eased(pose: Mapping[str, Any], ease: str) -> dict[str, Any]:
    """A pose that is moved through in another way: one to rest in has no rates."""
    left_out = RATES if ease == "rest" else ()
    return {**{name: each for name, each in pose.items() if name not in left_out}, "ease": ease}


def _row_at(poses: list[Any], at: float) -> int | None:
    """The pose that is there at a time in s."""
    near = [row for row, each in enumerate(poses) if abs(each["at"] - at) < SHORTEST_TIME]
    return min(near, key=lambda row: abs(poses[row]["at"] - at), default=None)


def _check_free(poses: list[Any], at: float) -> None:
    if (found := _row_at(poses, at)) is not None:
        raise MotionError(f"there is a pose at {poses[found]['at']:g} s already; delete that first")


def _check_track(track: str) -> None:
    if track not in TRACKS:
        raise MotionError(one_of("track", track, list(TRACKS)))


def _item(content: Content, name: str, number: int) -> Mapping[str, Any]:
    """A layer or an event."""
    if name != KEYS:
        _check_track(name)
    items: list[Mapping[str, Any]] = content.get(name, [])
    if not 0 <= number < len(items):
        raise MotionError(f"{name} has no item {number}; there are {len(items)}, from 0 on")
    return items[number]


def _pose(content: Content, layer: int, number: int) -> Mapping[str, Any]:
    poses: list[Mapping[str, Any]] = _item(content, KEYS, layer)["poses"]
    if not 0 <= number < len(poses):
        raise MotionError(f"layer {layer} has no pose {number}; there are {len(poses)}, from 0 on")
    return poses[number]


def _with(items: list[Any], number: int, item: Any) -> list[Any]:
    return [*items[:number], item, *items[number + 1 :]]


def _without(items: list[Any], number: int) -> list[Any]:
    return [*items[:number], *items[number + 1 :]]


def _in_order(items: list[Any]) -> list[Any]:
    return sorted(items, key=lambda item: float(item["at"]))


def _with_item(content: Content, name: str, number: int, item: Any) -> Content:
    return {**content, name: _with(content[name], number, item)}


def _with_poses(content: Content, layer: int, poses: list[Any]) -> Content:
    changed = {**content[KEYS][layer], "poses": _in_order(poses)}
    return _with_item(content, KEYS, layer, changed)


def _with_list(content: Content, name: str, items: list[Any]) -> Content:
    """With a list, or without it where it is empty."""
    return {**content, name: items} if items else _with_value(content, name, None)


def _with_value(content: Mapping[str, Any], name: str, value: Any) -> dict[str, Any]:
    kept = {key: each for key, each in content.items() if value is not None or key != name}
    return {**kept, name: value} if value is not None else kept
