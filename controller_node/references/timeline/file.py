"""The YAML file of a timeline, checked key by key; `docs/timeline.md` has its keys.

Entries are counted from 1. What they name of the character is checked where the motion is made.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from controller_node.references.limits import LARGEST_NUMBER
from controller_node.references.timeline.description import (
    BehaviourEntry,
    ClipEntry,
    Ease,
    Entry,
    Layer,
    PinEntry,
    Point,
    Pose,
    PushEntry,
    SteeringEntry,
    StrengthEntry,
    TargetEntry,
    ThrowEntry,
    Timeline,
)
from msgs_config import files
from msgs_config.errors import MotionError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.mappings import MappingReader, show_value

TIMELINES_DIRECTORY = Path(__file__).parent / "data"
_FILES = (".yaml", ".yml")
_NODES = ("sim_node", "controller_node")
_HERE, _NEVER = "here", "never"  # for the place of a clip or a pin, and for `out`
_BLEND = 0.3  # s
_SHORTEST = 1e-3  # s between two poses
_PIN_FORCES = (1e-3, 1e6)  # N, least and most
_BOUNDS = (-LARGEST_NUMBER, LARGEST_NUMBER)
_T = TypeVar("_T")
_TimedEntry = TypeVar("_TimedEntry", bound=Entry)
_LastingEntry = TypeVar("_LastingEntry", SteeringEntry, BehaviourEntry)


def shipped_timelines() -> list[str]:
    """The names of the timelines that come with the package."""
    return sorted(path.stem for path in TIMELINES_DIRECTORY.glob("*.yaml"))


def timeline_path(name: str) -> Path:
    """The file of a shipped timeline, or the path itself. Raises MotionError if there is none."""
    refuse_other_kind(Path(name), "a timeline (.yaml)", _FILES, MotionError)
    if name.endswith(_FILES):
        return Path(name)
    if name not in shipped_timelines():
        wrong = one_of("timeline", name, shipped_timelines())
        raise MotionError(f"{wrong}; or the path of a .yaml file")
    return TIMELINES_DIRECTORY / f"{name}.yaml"


def read_timeline(name: str) -> Timeline:
    """Read a shipped timeline, or a file.

    Raises:
        MotionError: names the file, the entry, the value and what would be right.
    """
    file = timeline_path(name)
    text = files.read_text(file, MotionError)
    return make_timeline(file, files.parse_yaml_mapping(file, text, MotionError))


def make_timeline(file: Path, content: dict[str, Any]) -> Timeline:
    """The timeline of a file's content. Raises MotionError as `read_timeline`."""
    reader = MappingReader(file, content, MotionError)
    tracks = (
        *("keys", "clips", "steering", "reach", "look", "limp", "strengths"),
        *("pushes", "pins", "throws", "behaviours"),
    )
    reader.check_keys(("character", "duration", "run", "set", *tracks))
    has_duration = content.get("duration") is not None
    limp = _track(file, content, "limp", _limp, ("at", "until"))
    strengths = _track(file, content, "strengths", _strength, ("at", "until", "joints", "strength"))
    target = ("at", "until", "point", "in", "out", "link")
    return Timeline(
        file=file,
        character=reader.text("character") if "character" in content else "humanoid",
        duration=_time(reader, "duration", _SHORTEST) if has_duration else None,
        run=_run(reader),
        settings=_settings(reader),
        layers=_track(file, content, "keys", _layer, ("name", "in", "out", "poses")),
        clips=_in_order(_track(file, content, "clips", _clip, _CLIP_KEYS)),
        steering=_apart(_track(file, content, "steering", _steering, _STEERING_KEYS), "velocity"),
        reaches=_track(file, content, "reach", _target, target),
        looks=_track(file, content, "look", _target, target),
        strengths=(*limp, *strengths),
        pushes=_track(file, content, "pushes", _push, ("at", "link", "force", "for")),
        pins=_track(file, content, "pins", _pin, ("at", "until", "link", "point", "force")),
        throws=_track(file, content, "throws", _throw, _THROW_KEYS),
        behaviours=_apart(
            _track(file, content, "behaviours", _behaviour, ("at", "until", "do")), "behaviour"
        ),
    )


_CLIP_KEYS = ("at", "clip", "from", "to", "blend", "place", "heading")
_RATES = ("velocity", "acceleration")
_STEERING_KEYS = ("at", "until", "velocity", "blend")
_THROW_KEYS = (
    *("at", "mass", "speed", "target", "from", "distance"),
    *("radius", "shape", "size", "slide"),
)


def _track(
    place: object,
    content: Mapping[str, Any],
    track: str,
    make: Callable[[MappingReader, str], _T],
    known: Sequence[str],
) -> tuple[_T, ...]:
    """The entries of a track, in the order of the file."""
    items, made = content.get(track), list[_T]()
    if items is None:
        return ()
    if not isinstance(items, list):
        raise MotionError(f"{place}: {track} is {show_value(items)}; it must be a list")
    for number, item in enumerate(items, start=1):
        entry = f"{place}: {track} {number}"
        if not isinstance(item, dict) or not all(isinstance(key, str) for key in item):
            raise MotionError(f"{entry} is {show_value(item)}; it must be a mapping with 'at'")
        reader = MappingReader(entry, item, MotionError)
        reader.check_keys(known)
        made.append(make(reader, entry))
    return tuple(made)


def _run(reader: MappingReader) -> dict[str, str]:
    """How it is run: options of `run` by name."""
    run = reader.part("run")
    run.check_keys(("planner", "behaviour"))
    return {name: run.text(name) for name in run.content}


def _settings(reader: MappingReader) -> dict[str, Mapping[str, object]]:
    """Parameters by node, of keys such as `controller_node.law`."""
    settings: dict[str, dict[str, object]] = {}
    for key, value in reader.part("set").content.items():
        node, _, name = key.partition(".")
        if node not in _NODES or not name:
            raise MotionError(
                f"{reader.place}: set: '{key}' is no parameter of a node; it must be "
                "controller_node.NAME or sim_node.NAME"
            )
        settings.setdefault(node, {})[name] = value
    return dict(settings)


def _layer(reader: MappingReader, place: str) -> Layer:
    poses = _track(place, reader.content, "poses", _pose, ("at", "pose", "ease", *_RATES))
    if not poses:
        raise MotionError(f"{place}: poses is missing; it must be a list of one pose or more")
    _check_rising(poses, _SHORTEST)
    if "name" in reader.content:
        reader.text("name")
    go = None if reader.content.get("out") == _NEVER else _blend(reader, "out")
    return Layer(place, poses, _blend(reader, "in"), go)


def _pose(reader: MappingReader, place: str) -> Pose:
    pose = reader.part("pose")
    if not pose.content:
        raise MotionError(f"{place}: pose is empty; it must have degrees of freedom, in rad or m")
    values = {name: pose.number(name, None, *_BOUNDS) for name in pose.content}
    ease = Ease(reader.choice("ease", [each.value for each in Ease]))
    rates = []
    for key in _RATES:
        own = reader.part(key)
        rates.append({name: own.number(name, None, *_BOUNDS) for name in own.content})
        if own.content and ease is Ease.REST:
            some = f"{'an' if key[0] == 'a' else 'a'} {key}"
            raise MotionError(f"{place}: a pose has {some} or 'ease: rest', not both; remove one")
    return Pose(place, _time(reader), values, ease, *rates)


def _clip(reader: MappingReader, place: str) -> ClipEntry:
    begin = reader.number("from", 0.0, 0.0, LARGEST_NUMBER)
    end = _later(reader, "to", begin, "from") if "to" in reader.content else None
    position, heading = None, None
    if reader.content.get("place", _HERE) != _HERE:
        x, y = reader.numbers("place", 2, _BOUNDS)
        position = x, y
    if reader.content.get("heading", _HERE) != _HERE:
        heading = reader.number("heading", None, *_BOUNDS)
    clip, blend = reader.text("clip"), _blend(reader, "blend")
    return ClipEntry(place, _time(reader), clip, begin, end, blend, position, heading)


def _steering(reader: MappingReader, place: str) -> SteeringEntry:
    at = _time(reader)
    until = _later(reader, "until", at)
    return SteeringEntry(place, at, until, _vector(reader, "velocity"), _blend(reader, "blend"))


def _target(reader: MappingReader, place: str) -> TargetEntry:
    at, link = _time(reader), reader.text("link") if "link" in reader.content else ""
    until, point = _later(reader, "until", at), _vector(reader, "point")
    return TargetEntry(place, at, until, point, _blend(reader, "in"), _blend(reader, "out"), link)


def _limp(reader: MappingReader, place: str) -> StrengthEntry:
    at = _time(reader)
    return StrengthEntry(place, at, _later(reader, "until", at), 0.0, ())


def _strength(reader: MappingReader, place: str) -> StrengthEntry:
    at, strength = _time(reader), reader.number("strength", None, 0.0, 1.0)
    joints = reader.names("joints", "joints", [])
    return StrengthEntry(place, at, _later(reader, "until", at), strength, joints)


def _push(reader: MappingReader, place: str) -> PushEntry:
    duration = _time(reader, "for", _SHORTEST) if "for" in reader.content else None
    link, force = reader.text("link"), _vector(reader, "force")
    return PushEntry(place, _time(reader), link, force, duration)


def _pin(reader: MappingReader, place: str) -> PinEntry:
    at, link = _time(reader), reader.text("link")
    until, force = _later(reader, "until", at), reader.number("force", None, *_PIN_FORCES)
    point = None if reader.content.get("point") == _HERE else _vector(reader, "point")
    return PinEntry(place, at, until, link, point, force)


def _throw(reader: MappingReader, place: str) -> ThrowEntry:
    return ThrowEntry(place, _time(reader), reader.content)


def _behaviour(reader: MappingReader, place: str) -> BehaviourEntry:
    at = _time(reader)
    until = _later(reader, "until", at) if "until" in reader.content else None
    return BehaviourEntry(place, at, until, reader.text("do"))


def _time(reader: MappingReader, key: str = "at", least: float = 0.0) -> float:
    return reader.number(key, None, least, LARGEST_NUMBER)


def _later(reader: MappingReader, key: str, begin: float, than: str = "at") -> float:
    end = _time(reader, key)
    if end < begin + _SHORTEST:
        raise reader.wrong(key, end, f"later than '{than}', {begin:g} s")
    return end


def _blend(reader: MappingReader, key: str) -> float:
    blend = reader.number(key, _BLEND, 0.0, LARGEST_NUMBER)
    if 0.0 < blend < _SHORTEST:
        raise reader.wrong(key, blend, f"0, or {_SHORTEST:g} s or more")
    return blend


def _vector(reader: MappingReader, key: str) -> Point:
    x, y, z = reader.numbers(key, 3, _BOUNDS)
    return x, y, z


def _in_order(entries: Iterable[_TimedEntry]) -> tuple[_TimedEntry, ...]:
    """Entries by their times, of which no two are equal."""
    ordered = tuple(sorted(entries, key=lambda each: each.at))
    _check_rising(ordered, _SHORTEST)
    return ordered


def _apart(entries: Iterable[_LastingEntry], what: str) -> tuple[_LastingEntry, ...]:
    """Entries by their times, each over before the next one begins; `what` is their name."""
    ordered = _in_order(entries)
    for before, after in pairwise(ordered):
        if before.until is not None and after.at < before.until:
            raise MotionError(
                f"{after.place}: at is {after.at:g}; it must be {before.until:g} s or later, when "
                f"the {what} before is over"
            )
    return ordered


def _check_rising(entries: Sequence[Entry], least: float) -> None:
    for before, after in pairwise(entries):
        if after.at - before.at < least:
            raise MotionError(
                f"{after.place}: at is {after.at:g}; it must be later than the {before.at:g} s of "
                "the one before"
            )
