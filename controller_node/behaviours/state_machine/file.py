"""The YAML file of a state machine, checked key by key before anything starts.

`docs/state_machines.md` has its keys.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from controller_node.behaviours.state_machine.description import (
    BALANCE,
    CENTRE,
    FEET,
    HIP,
    QUANTITIES,
    STANCE,
    STAND,
    SWING,
    Condition,
    End,
    Feedback,
    FootPlacement,
    Gains,
    JointTarget,
    Likeness,
    Machine,
    PressureTarget,
    RootTarget,
    State,
)
from controller_node.behaviours.state_machine.laws import PLACEMENT_LAWS
from controller_node.behaviours.state_machine.support import Bounds
from controller_node.references.steering.velocity import VelocityRegion
from msgs_config import files
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.mappings import MappingReader

MACHINES_DIRECTORY = Path(__file__).parent / "data"
_KEYS = [
    *("sides", "start", "includes", "changes", "joins", "acceleration", "limits", "gains"),
    *("bounds", "states"),
]
_STATE_KEYS = [
    *("feet", "duration", "blend", "root", "pressure", "placement", "targets", "gains"),
    *("efforts", "tracks", "ends"),
]
_CHANGEABLE = ("duration", "root", "pressure", "placement")
_FILES = (".yaml", ".yml")
_NEVER = "never"
_PARTS = ("hip", "knee", "ankle")  # parts that every side has
_DEPTH = 8  # the most files that include each other in a row


def shipped_machines() -> list[str]:
    """The names of the machines that come with the package."""
    return sorted(path.stem for path in MACHINES_DIRECTORY.glob("*.yaml"))


def machine_path(name: str) -> Path:
    """The file of a shipped machine, or the path itself.

    Raises:
        ConfigurationError: there is no shipped machine of that name.
    """
    refuse_other_kind(Path(name), "a state machine", _FILES, ConfigurationError)
    if name.endswith(_FILES):
        return Path(name)
    if name not in shipped_machines():
        wrong = one_of("machine", name, shipped_machines())
        raise ConfigurationError(f"{wrong}; or the path of a .yaml file")
    return MACHINES_DIRECTORY / f"{name}.yaml"


def read_machine(name: str) -> Machine:
    """Read a shipped machine, or a file. What it names of the character is checked later.

    Raises:
        ConfigurationError: names the file, the key, the value and what would be right.
    """
    path = machine_path(name)
    return make_machine(path, read_content(path))


def read_content(path: Path) -> dict[str, Any]:
    """What a file has. Raises ConfigurationError if it is no YAML mapping."""
    text = files.read_text(path, ConfigurationError)
    return files.parse_yaml_mapping(path, text, ConfigurationError)


def make_machine(path: Path, content: dict[str, Any], depth: int = _DEPTH) -> Machine:
    """The machine of a file's content, which may include so many files, one in another."""
    if not depth:
        raise ConfigurationError(f"{path}: more than {_DEPTH} files include each other")
    reader = MappingReader(path, content, ConfigurationError)
    reader.check_keys(_KEYS)
    sides = _sides(reader)
    states: dict[str, State] = {}
    includes = reader.part("includes")
    for prefix in includes.content:
        other = _beside(path, includes.text(prefix))
        included = make_machine(other, read_content(other), depth - 1)
        if included.sides != sides:
            raise ConfigurationError(f"{path}: the sides must be those of {included.file}")
        for state in included.states.values():
            states[f"{prefix}.{state.name}"] = _prefixed(state, prefix)
    gains = _gains(reader.part("gains"))
    bounds = _values(reader.part("bounds"), Bounds())
    parts = reader.part("states")
    for name in parts.content:
        states[name] = _state(name, parts.part(name), gains, bounds)
    changes = reader.part("changes")
    for name in changes.content:
        state = _named(states, name, changes)
        states[name] = _changed(state, changes.part(name))
    joins = reader.part("joins")
    for name in joins.content:
        state = _named(states, name, joins)
        states[name] = replace(state, ends=_ends(joins, name) + state.ends)
    acceleration = reader.number("acceleration", 1e9, 1e-3, 1e9)
    if not states:
        raise reader.wrong("states", content.get("states"), "a mapping of one state or more")
    limits = _limits(reader.part("limits"))
    return Machine(path, sides, reader.text("start"), states, acceleration, limits)


def _named(states: Mapping[str, State], name: str, reader: MappingReader) -> State:
    if name not in states:
        wrong = one_of("state", name, list(states))
        raise ConfigurationError(f"{reader.place}: {reader.prefix[:-1]}: {wrong}")
    return states[name]


def _changed(state: State, reader: MappingReader) -> State:
    """A state with other numbers of how it stands and steps."""
    reader.check_keys(_CHANGEABLE)
    root = reader.part("root")
    height = root.number("height", state.root.height, 0.0, 1e3)
    return replace(
        state,
        duration=reader.number("duration", state.duration, 1e-3, 1e6),
        root=_values(root, replace(state.root, height=height)),
        pressure=_values(reader.part("pressure"), state.pressure),
        placement=_placement(reader.part("placement"), state.placement),
    )


def _limits(reader: MappingReader) -> VelocityRegion:
    """The velocities that a machine takes, m/s and rad/s; what is not said has no limit."""
    names = [field.name for field in fields(VelocityRegion)]
    reader.check_keys(names)
    return VelocityRegion(
        *(
            reader.number(name, 0.0, 0.0, 1e3) if name in reader.content else math.inf
            for name in names
        )
    )


def _beside(path: Path, name: str) -> Path:
    return path.parent / name if name.endswith((".yaml", ".yml")) else machine_path(name)


def _prefixed(state: State, prefix: str) -> State:
    """A state of an included machine."""
    ends = tuple(replace(end, then=f"{prefix}.{end.then}") for end in state.ends)
    return replace(state, name=f"{prefix}.{state.name}", ends=ends)


def _sides(reader: MappingReader) -> dict[str, dict[str, str]]:
    part = reader.part("sides")
    sides = {}
    for side in part.content:
        joints = part.part(side)
        sides[side] = {name: joints.text(name) for name in joints.content}
    whole = all(set(_PARTS) <= set(each) for each in sides.values())
    if set(sides) != {"left", "right"} or not whole:
        raise reader.wrong(
            "sides",
            reader.content.get("sides"),
            "'left' and 'right', of which the first stands first, each with a hip, a knee and an "
            "ankle",
        )
    first, second = sides.values()
    if set(first) != set(second):
        odd = sorted(set(first) ^ set(second))[0]
        raise part.wrong(odd, None, "a joint of both sides, or of none")
    return sides


def _state(name: str, reader: MappingReader, gains: dict[str, Gains], bounds: Bounds) -> State:
    reader.check_keys(_STATE_KEYS)
    feet = reader.part("feet")
    feet.check_keys((STANCE, SWING))
    roles = {role: feet.choice(role, [STAND, *FEET]) for role in (STANCE, SWING)}
    root = reader.part("root")
    stands = STAND in roles.values()
    height = root.number("height", None if stands else 0.0, 0.0, 1e3)
    return State(
        name=name,
        feet=roles,
        duration=reader.number("duration", 1.0, 1e-3, 1e6),
        blend=reader.number("blend", 0.0, 0.0, 1e6),
        root=_values(root, RootTarget(height)),
        pressure=_values(reader.part("pressure"), PressureTarget()),
        placement=_placement(reader.part("placement"), FootPlacement()),
        targets=_targets(reader.part("targets")),
        gains={**gains, **_gains(reader.part("gains"))},
        efforts=_efforts(reader.part("efforts")),
        bounds=bounds,
        ends=_ends(reader, "ends"),
        tracks=reader.flag("tracks"),
    )


def _values(reader: MappingReader, default: Any) -> Any:
    """A frozen description with the numbers, pairs and texts that a mapping has."""
    known = {field.name for field in fields(default)}
    reader.check_keys(sorted(known))
    changed: dict[str, Any] = {}
    for key in known:
        value = getattr(default, key)
        if isinstance(value, tuple):
            changed[key] = reader.numbers(key, len(value), default=list(value))
        elif isinstance(value, str):
            changed[key] = reader.content.get(key, value)
        else:
            changed[key] = reader.number(key, value, -1e9, 1e9)
    return type(default)(**changed)


def _placement(reader: MappingReader, default: FootPlacement) -> FootPlacement:
    placement: FootPlacement = _values(reader, default)
    if placement.law not in PLACEMENT_LAWS:
        raise reader.wrong("law", placement.law, " or ".join(f"'{law}'" for law in PLACEMENT_LAWS))
    if placement.origin not in (HIP, CENTRE):
        raise reader.wrong("origin", placement.origin, f"'{HIP}' or '{CENTRE}'")
    return placement


def _gains(reader: MappingReader) -> dict[str, Gains]:
    return {
        joint: reader.numbers(joint, 2, (0.0, 1e9))  # type: ignore[misc]
        for joint in reader.content
    }


def _targets(reader: MappingReader) -> tuple[JointTarget, ...]:
    return tuple(_target(joint, reader) for joint in reader.content)


def _target(joint: str, reader: MappingReader) -> JointTarget:
    value = reader.content[joint]
    if isinstance(value, dict):
        part = reader.part(joint)
        if "like" in part.content:
            return _likeness(joint, part)
        part.check_keys(("roll", "pitch", "yaw", "sagittal", "coronal"))
        angles = tuple(part.number(axis, 0.0, -10.0, 10.0) for axis in ("roll", "pitch", "yaw"))
        pairs = [part.numbers(key, 2, default=[0.0, 0.0]) for key in ("sagittal", "coronal")]
        feedback = Feedback(*pairs)  # type: ignore[arg-type]
        return JointTarget(joint, angles, True, feedback)  # type: ignore[arg-type]
    if isinstance(value, list):
        x, y, z = reader.numbers(joint, 3, (-10.0, 10.0))
        return JointTarget(joint, (x, y, z))
    angle = reader.number(joint, None, -1e3, 1e3)
    return JointTarget(joint, (angle, 0.0, 0.0), size=1)


def _likeness(joint: str, part: MappingReader) -> JointTarget:
    """The target of a joint that goes with a leg."""
    part.check_keys(("like", "share", "rest"))
    role = part.choice("like", [SWING, STANCE])
    x, y, z = part.numbers("share", 3, (-10.0, 10.0))
    a, b, c = part.numbers("rest", 3, (-10.0, 10.0), default=[0.0, 0.0, 0.0])
    return JointTarget(joint, (a, b, c), likeness=Likeness(role, (x, y, z)))


def _efforts(reader: MappingReader) -> dict[str, str | tuple[float, ...]]:
    efforts: dict[str, str | tuple[float, ...]] = {}
    for joint, value in reader.content.items():
        if value == BALANCE:
            efforts[joint] = BALANCE
        elif isinstance(value, list):
            efforts[joint] = reader.numbers(joint, 3, (-1e6, 1e6))
        elif isinstance(value, str):
            raise reader.wrong(joint, value, f"'{BALANCE}', a number or three, N m")
        else:
            efforts[joint] = (reader.number(joint, None, -1e6, 1e6),)
    return efforts


def _ends(reader: MappingReader, key: str) -> tuple[End, ...]:
    items = reader.content.get(key)
    if items == _NEVER:
        return ()
    if not isinstance(items, list) or not items:
        raise reader.wrong(key, items, f"a list of one end or more, or '{_NEVER}'")
    return tuple(_end(reader, f"{key} {number}", item) for number, item in enumerate(items, 1))


def _end(reader: MappingReader, key: str, item: object) -> End:
    holder = MappingReader(reader.place, {key: item}, ConfigurationError, reader.prefix)
    part = holder.part(key)
    part.check_keys(("when", "then", "swap"))
    when = part.part("when")
    if not when.content:
        raise part.wrong("when", None, "conditions, such as {time: '> 0.5'}")
    conditions = tuple(_condition(when, quantity) for quantity in when.content)
    return End(part.text("then"), conditions, part.flag("swap"))


def _condition(when: MappingReader, quantity: str) -> Condition:
    when.check_keys(QUANTITIES)
    text = when.content[quantity]
    sign, number = (text[:1], text[1:].strip()) if isinstance(text, str) else ("", "")
    try:
        if sign not in ("<", ">"):
            raise ValueError
        return Condition(quantity, sign == ">", float(number))
    except ValueError:
        right = f"'> NUMBER' or '< NUMBER', {QUANTITIES[quantity]}"
        raise when.wrong(quantity, text, right) from None
