"""What is marked on the time line of a timeline: keys, and events of the other tracks."""

from collections.abc import Mapping
from typing import Any

from actuated_characters.timeline.content import KEYS, TRACKS, Content, is_number
from actuated_characters.viewer.editor.event_forms import describe_event
from actuated_characters.viewer.editor.items import Item
from actuated_characters.viewer.recorded.marks import END, KEYFRAME, Mark

_KINDS = {"pushes": "push", "throws": "throw"}
_SPAN = "mode"
_COLORS = {
    "clips": "#1f77b4",
    "steering": "#17becf",
    "reach": "#2ca02c",
    "look": "#8c6d31",
    "limp": "#7f7f7f",
    "strengths": "#9467bd",
    "behaviours": "#bcbd22",
    "pins": "#d62728",
}


def find_key_marks(content: Content, length: float) -> list[Mark]:
    """The marks by their start, each with its item; the time line is so long, s."""
    marks = [Mark(END, length, length, "the end")]
    for layer, each in enumerate(content.get(KEYS, [])):
        for number, pose in enumerate(each["poses"]):
            at, key = float(pose["at"]), str(Item(KEYS, number, layer))
            text = _describe_key(layer, each, pose)
            marks.append(Mark(KEYFRAME, at, at, text, lane=layer, item=key))
    lanes: list[tuple[str, float]] = []  # the track of each row, and when its last event ends, s
    for track in TRACKS:
        for number, event in enumerate(content.get(track, [])):
            start, text = float(event["at"]), describe_event(track, number, event)
            item = Item(track, number)
            if not item.lasts:
                marks.append(Mark(_KINDS[track], start, start, text, item=str(item)))
                continue
            end = _end_of(event)
            lane = _free_lane(lanes, track, start)
            lanes[lane] = (track, end)
            marks.append(Mark(_SPAN, start, end, text, track, _COLORS[track], lane, str(item)))
    return sorted(marks, key=lambda mark: mark.start)


def _free_lane(lanes: list[tuple[str, float]], track: str, start: float) -> int:
    """A row of the track in which nothing is at a time in s; a new one if there is none."""
    for lane, (name, end) in enumerate(lanes):
        if name == track and end <= start:
            return lane
    lanes.append((track, start))
    return len(lanes) - 1


def _describe_key(number: int, layer: Mapping[str, Any], pose: Mapping[str, Any]) -> str:
    name = layer.get("name") or f"layer {number + 1}"
    names = list(pose["pose"])
    what = ", ".join(names) if len(names) <= 3 else f"{len(names)} degrees of freedom"
    ease = f", {pose['ease']}" if "ease" in pose else ""
    return f"key of {name}: {what}{ease}"


def _end_of(event: Mapping[str, Any]) -> float:
    """When a span ends, s; a clip by its own times, else it is as short as can be seen."""
    start = float(event["at"])
    if is_number(event.get("until")):
        return max(start, float(event["until"]))
    if is_number(event.get("to")):
        begin = event.get("from", 0.0)
        return start + max(float(event["to"]) - (float(begin) if is_number(begin) else 0.0), 0.1)
    return start + 0.1
