"""The content of a timeline's file as plain values, and the text that stands for it.

What is checked here is its form alone: that there are keys and events where an editor looks for
them. Names, units and ranges are the concern of who plays it.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias, TypeGuard

import yaml

from msgs_config import files
from msgs_config.errors import MotionError, one_of

Content: TypeAlias = Mapping[str, Any]
"""A whole timeline; nobody changes one, an edit makes another."""

KEYS = "keys"
TRACKS = (
    *("clips", "steering", "reach", "look", "limp", "strengths", "behaviours"),
    *("pushes", "pins", "throws"),
)
"""The lists of events."""
RATES = ("velocity", "acceleration")
"""What a pose may say of its motion, beside `ease`."""
TOP_LEVEL = ("character", "duration", "run", "set", KEYS, *TRACKS)

_LINE_WIDTH = 110  # characters


def parse(place: Path, text: str) -> dict[str, Any]:
    """The content of a file's text; empty text is an empty timeline.

    Raises:
        MotionError: it is no YAML, or not of a timeline's form; says where.
    """
    content = files.parse_yaml_mapping(place, text, MotionError) if text.strip() else {}
    for name in content:
        if name not in TOP_LEVEL:
            raise MotionError(f"{place}: {one_of('key', name, list(TOP_LEVEL))}")
    for name in (KEYS, *TRACKS):
        if content.get(name) is None:
            content.pop(name, None)
        _check_list(f"{place}: {name}", content.get(name, []))
    for number, layer in enumerate(content.get(KEYS, []), 1):
        where = f"{place}: keys {number}: poses"
        _check_list(where, layer.get("poses"))
        for pose_number, pose in enumerate(layer["poses"], 1):
            _check_time(f"{where} {pose_number}", pose)
            _check_mapping(f"{where} {pose_number}: pose", pose.get("pose"))
            for name in RATES:
                _check_mapping(f"{where} {pose_number}: {name}", pose.get(name) or {})
    for track in TRACKS:
        for number, event in enumerate(content.get(track, []), 1):
            _check_time(f"{place}: {track} {number}", event)
    return content


def _check_list(place: str, value: object) -> None:
    if not isinstance(value, list):
        raise MotionError(f"{place} must be a list")
    for number, each in enumerate(value, 1):
        _check_mapping(f"{place} {number}", each)


def _check_mapping(place: str, value: object) -> None:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise MotionError(f"{place} must be a mapping")


def _check_time(place: str, item: Mapping[str, Any]) -> None:
    if not is_number(item.get("at")):
        raise MotionError(f"{place}: at must be a time in s, a number")


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a finite number, and not true or false."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < float("inf")


def dump(content: Content) -> str:
    """The text of a content: its keys in the order of a hand-written file, without comments."""
    ordered = {name: content[name] for name in TOP_LEVEL if name in content}
    return yaml.dump(
        ordered,
        Dumper=_Dumper,
        sort_keys=False,
        default_flow_style=None,
        width=_LINE_WIDTH,
        allow_unicode=True,
    )


class _Dumper(yaml.SafeDumper):
    """Plain data, every number so that YAML 1.2 reads it, and nothing by reference."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write what stands in two places twice."""
        del data
        return True


@lru_cache(maxsize=1 << 12)  # names of degrees of freedom come again in each pose
def _is_plain(text: str) -> bool:
    """Whether a reader of decimal numbers takes a text without quotes for what it is."""
    try:
        return bool(files.parse_yaml("text", text, MotionError) == text)
    except MotionError:
        return False


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = None if _is_plain(text) else "'"
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _represent_text)
