"""What trainers write of a policy, in the keys of our own file.

- The metadata of an ONNX file, by the exporters of rsl_rl's tasks (whole_body_tracking, mjlab):
  texts; of lists the entries, by commas.
- `deploy.yaml` of unitree_rl_lab: observations and actions as Isaac Lab has them. Stiffness and
  damping are in the order of the robot's motors there; all else is in that of the policy.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgs_config.errors import ConfigurationError
from msgs_config.mappings import MappingReader

_NAMES = ("joint_names", "observation_names", "command_names", "body_names")
_NUMBERS = ("default_joint_pos", "joint_stiffness", "joint_damping", "action_scale")
_HISTORY = "observation_history_lengths"
_RELATIVE = {"joint_pos": "joint_pos_rel"}  # those tasks name it so, and subtract the default pose
_SLICE = "!!python/object/apply:builtins.slice"
_MOTOR_ORDER = "joint_ids_map"
_ACTION = "JointPositionAction"


def from_metadata(metadata: Mapping[str, str]) -> dict[str, Any]:
    """The keys of our file that an ONNX file's metadata have."""
    lists = {name: _split(metadata[name]) for name in _NAMES if metadata.get(name)}
    found: dict[str, Any] = {
        name: [_number(each) for each in _split(metadata[name])]
        for name in _NUMBERS
        if metadata.get(name)
    }
    if len(found.get("action_scale", ())) == 1:
        found["action_scale"] = found["action_scale"][0]
    found |= {name: lists[name] for name in ("joint_names", "body_names") if name in lists}
    if metadata.get("anchor_body_name"):
        found["anchor_body_name"] = metadata["anchor_body_name"]
    if "observation_names" in lists:
        commands = lists.get("command_names", [])
        found["observations"] = {
            name: {"term": _term_of(name, commands)} for name in lists["observation_names"]
        }
        lengths = map(_number, _split(metadata.get(_HISTORY, "")))
        for term, length in zip(found["observations"].values(), lengths, strict=False):
            term["history_length"] = length
    return found


def _term_of(name: str, commands: list[str]) -> str:
    if name == "command":
        return "motion_command" if "motion" in commands else "velocity_commands"
    return _RELATIVE.get(name, name)


def _split(text: str) -> list[str]:
    return [each.strip() for each in text.split(",")] if text.strip() else []


def _number(text: str) -> Any:
    """A number, or the text as it is, which is refused where a number belongs."""
    try:
        number = float(text)
    except ValueError:
        return text
    return int(number) if number.is_integer() else number


def without_slice_tags(text: str) -> str:
    """A YAML file's text whose slices of Python, as Isaac Lab writes them, are plain lists."""
    return text.replace(_SLICE, "")


def is_deploy(content: Mapping[str, Any]) -> bool:
    """Whether a YAML file's content is a `deploy.yaml`, maybe with keys of ours beside."""
    return _MOTOR_ORDER in content


def from_deploy(path: Path, content: dict[str, Any]) -> dict[str, Any]:
    """The keys of our file that a `deploy.yaml` has; keys of ours in it stay.

    Raises:
        ConfigurationError: it is malformed, or the policy's actions are no positions of all joints.
    """
    theirs = {_MOTOR_ORDER, "stiffness", "damping", "commands", "actions", "motor_names"}
    reader = MappingReader(path, content, ConfigurationError)
    found = {key: value for key, value in content.items() if key not in theirs}
    order = _motor_order(reader)
    for key, ours in (("stiffness", "joint_stiffness"), ("damping", "joint_damping")):
        by_motor = reader.numbers(key, len(order))
        found.setdefault(ours, [by_motor[motor] for motor in order])
    if "motor_names" in content:
        motors = reader.names("motor_names", "the robot's motors")
        if len(motors) != len(order):
            raise reader.wrong("motor_names", list(motors), f"a list of {len(order)} names")
        found.setdefault("joint_names", [motors[motor] for motor in order])
    if "joint_names" not in found:
        raise ConfigurationError(
            f"{path}: it names no joints; add 'motor_names', in the order that '{_MOTOR_ORDER}' "
            "counts, or 'joint_names', in the policy's order"
        )
    found |= _action(reader)
    observations = reader.part("observations")
    found["observations"] = {
        name: _observation(observations.part(name).content) for name in observations.content
    }
    return found


def _motor_order(reader: MappingReader) -> list[int]:
    """Which motor each joint of the policy is."""
    order = reader.content[_MOTOR_ORDER]
    if not isinstance(order, list) or sorted(map(str, order)) != sorted(
        map(str, range(len(order)))
    ):
        raise reader.wrong(_MOTOR_ORDER, order, "a list with each of 0, 1, 2, ... once")
    return [int(each) for each in order]


def _action(reader: MappingReader) -> dict[str, Any]:
    actions = reader.part("actions")
    actions.check_keys((_ACTION,))
    action = actions.part(_ACTION)
    if action.content.get("joint_ids") not in (None, [None, None, None]):  # a slice of all
        raise action.wrong("joint_ids", action.content["joint_ids"], "null: all joints")
    found = {"action_scale": action.content.get("scale")}
    if action.content.get("offset") is not None:
        found["action_offset"] = action.content["offset"]
    if action.content.get("clip") is not None:
        found["target_clip"] = action.content["clip"]
    return found


def _observation(content: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: content[key] for key in ("scale", "clip", "history_length") if key in content}
    params = content.get("params")
    if isinstance(params, dict) and "period" in params:
        kept["period"] = params["period"]
    return kept
