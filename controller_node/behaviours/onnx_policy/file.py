"""A policy's description: of the network's own metadata, and of the YAML file beside it.

What the YAML file says (`policy.yaml` beside `policy.onnx`) counts instead of the metadata. Its
keys are in docs/policies.md.
"""

from pathlib import Path
from typing import Any

import numpy as np

from controller_node.behaviours.onnx_policy.description import (
    GROUPINGS,
    ORDERS,
    STARTS,
    Description,
    History,
    UsedTerm,
)
from controller_node.behaviours.onnx_policy.session import Network
from controller_node.behaviours.onnx_policy.terms import QUATERNIONS, TERMS, TermOptions
from controller_node.behaviours.onnx_policy.trainers import (
    from_deploy,
    from_metadata,
    is_deploy,
    without_slice_tags,
)
from msgs_config import files
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.mappings import MappingReader

_KEYS = (
    *("joint_names", "held_joints", "default_joint_pos", "joint_stiffness", "joint_damping"),
    *("action_scale", "action_offset", "action_clip", "target_clip", "step_dt", "observations"),
    *(
        "history_order",
        "history_by",
        "history_start",
        "recurrent",
        "anchor_body_name",
        "body_names",
    ),
)
_TERM_KEYS = ("term", "scale", "clip", "history_length", "period", "quaternion")
_ALIASES = {"joint_vel": "joint_vel_rel", "actions": "last_action", "phase": "gait_phase"}
_EITHER = "joint_pos"
_MOST_FRAMES = 1000


def description_path(network: Path) -> Path:
    """The YAML file of a network; it need not exist."""
    return network.with_suffix(".yaml")


def read_description(network: Network) -> Description:
    """What the network's metadata and its YAML file say together.

    Raises:
        ConfigurationError: names the file, the key, the value and what would be right.
    """
    path, content = description_path(network.path), from_metadata(network.metadata)
    if path.exists():
        text = without_slice_tags(files.read_text(path, ConfigurationError))
        given = files.parse_yaml_mapping(path, text, ConfigurationError)
        content |= from_deploy(path, given) if is_deploy(given) else given
        place = path
    else:
        place = network.path
    reader = _Reader(place, content, ConfigurationError)
    reader.missing = f"; write it in {path}"
    reader.check_keys(_KEYS)
    return _describe(reader, network)


class _Reader(MappingReader):
    """Takes what is said of a policy."""

    missing = ""
    joints: tuple[str, ...] = ()

    def needed(self, key: str, what: str) -> Any:
        """A value that must be there."""
        if self.content.get(key) is None:
            raise ConfigurationError(f"{self.place}: it has no '{key}', {what}{self.missing}")
        return self.content[key]

    def of_joints(self, key: str, what: str, least: float = -1e9) -> FloatArray:
        """One number of each joint (m,): a list, a mapping by name, or one for all."""
        value = self.needed(key, what)
        if isinstance(value, dict):
            part = self.part(key)
            part.check_keys(self.joints)
            return np.array([part.number(joint, None, least) for joint in self.joints])
        if isinstance(value, list):
            return np.array(self.numbers(key, len(self.joints), (least, 1e9)))
        return np.full(len(self.joints), self.number(key, None, least))

    def bounds(self, key: str) -> tuple[float, float] | None:
        """A least and a largest value, also as the one number that both are away from zero."""
        value = self.content.get(key)
        if value is None:
            return None
        if isinstance(value, list):
            low, high = self.numbers(key, 2)
        else:
            high = self.number(key, None, 0.0)
            low = -high
        if low > high:
            raise self.wrong(key, value, "a least and a largest number")
        return low, high


def _describe(reader: _Reader, network: Network) -> Description:
    reader.needed("joint_names", "the joints in the policy's order")
    joints = reader.joints = reader.names("joint_names", "joints")
    twice = next((joint for joint in joints if joints.count(joint) > 1), None)
    if twice is not None:
        raise ConfigurationError(f"{reader.place}: joint_names: '{twice}' is named twice")
    default = reader.of_joints("default_joint_pos", "the pose of the joints at action 0, rad or m")
    terms = _terms(reader)
    has_offset = reader.content.get("action_offset") is not None
    return Description(
        joints=joints,
        held_joints=reader.names("held_joints", "joints", []),
        default=default,
        stiffness=reader.of_joints("joint_stiffness", "the PD law's, N m/rad or N/m", 0.0),
        damping=reader.of_joints("joint_damping", "the PD law's, N m s/rad or N s/m", 0.0),
        action_scale=reader.of_joints("action_scale", "rad or m of an action of 1"),
        action_offset=reader.of_joints("action_offset", "rad or m") if has_offset else default,
        action_clip=reader.bounds("action_clip"),
        target_clip=_target_clip(reader),
        step_s=_step(reader),
        terms=terms,
        history=History(
            reader.choice("history_order", list(ORDERS)),
            reader.choice("history_by", list(GROUPINGS)),
            reader.choice("history_start", list(STARTS)),
        ),
        anchor=_anchor(reader, terms),
        motion_bodies=reader.names("body_names", "links", []),
        recurrent=_recurrent(reader, network),
    )


def _anchor(reader: _Reader, terms: tuple[UsedTerm, ...]) -> str:
    if not any(used.term.needs_anchor for used in terms):
        return ""
    reader.needed("anchor_body_name", "the link that a motion's place is said of")
    return reader.text("anchor_body_name")


def _step(reader: _Reader) -> float:
    reader.needed("step_dt", "s from one decision to the next: 'decimation' steps of the trainer")
    return reader.number("step_dt", None, 1e-6, 1e3)


def _target_clip(reader: _Reader) -> FloatArray | None:
    """The least and the largest target of each joint (m, 2)."""
    value, count = reader.content.get("target_clip"), len(reader.joints)
    if value is None:
        return None
    pairs = MappingReader(
        reader.place,
        dict(enumerate(value if isinstance(value, list) else [])),  # type: ignore[arg-type]
        ConfigurationError,
        "target_clip.",
    )
    if len(pairs.content) != count:
        raise reader.wrong("target_clip", value, f"a list of {count} pairs, one a joint")
    return np.array([pairs.numbers(row, 2) for row in pairs.content])


def _terms(reader: _Reader) -> tuple[UsedTerm, ...]:
    reader.needed("observations", "the terms of the observation, in their order")
    observations = reader.part("observations")
    used = [_term(reader, observations, name) for name in observations.content]
    if not used:
        raise reader.wrong("observations", {}, "a mapping of one term or more")
    if reader.content.get("history_by") == "frame" and len({term.history for term in used}) > 1:
        raise ConfigurationError(
            f"{reader.place}: history_by is 'frame', which needs the same history_length of all "
            f"terms; they have {', '.join(f'{each.name} {each.history}' for each in used)}"
        )
    return tuple(used)


def _term(reader: _Reader, observations: MappingReader, name: str) -> UsedTerm:
    part = observations.part(name)
    own = _Reader(part.place, part.content, ConfigurationError, part.prefix)
    own.check_keys(_TERM_KEYS)
    wanted = own.text("term") if "term" in own.content else name
    if wanted == _EITHER:
        raise ConfigurationError(
            f"{reader.place}: {own.prefix[:-1]} may be the position itself or what it is off the "
            "default pose; write joint_pos_abs or joint_pos_rel"
        )
    if (kind := _ALIASES.get(wanted, wanted)) not in TERMS:
        wrong = one_of("term", wanted, list(TERMS), observations.prefix)
        raise ConfigurationError(f"{reader.place}: {wrong}")
    term = TERMS[kind]
    options = TermOptions()
    if term.needs_period:
        options = options._replace(period=own.number("period", None, 1e-3, 1e6))
    if term.needs_quaternion:
        order = own.content.get("quaternion")
        if order not in QUATERNIONS:
            raise own.wrong(
                "quaternion", order, f"the order of its entries, {' or '.join(QUATERNIONS)}"
            )
        options = options._replace(quaternion=order)
    labels = tuple(term.labels(reader.joints, options))
    return UsedTerm(
        name,
        term,
        options,
        labels,
        _scale(own, len(labels)),
        own.bounds("clip"),
        _history(own),
    )


def _scale(own: _Reader, size: int) -> FloatArray:
    value = own.content.get("scale")
    if isinstance(value, list):
        return np.array(own.numbers("scale", size))
    return np.full(size, 1.0 if value is None else own.number("scale"))


def _history(own: _Reader) -> int:
    length = own.number("history_length", 1, 0, _MOST_FRAMES)
    if not length.is_integer():
        raise own.wrong("history_length", length, "a whole number")
    return max(int(length), 1)  # trainers write 0 where there is none


def _recurrent(reader: _Reader, network: Network) -> dict[str, str]:
    """The pairs of the file; else those of inputs `NAME_in` and outputs `NAME_out`."""
    part = reader.part("recurrent")
    if part.content:
        return {name: part.text(name) for name in part.content}
    pairs = {
        name: f"{name.removesuffix('_in')}_out"
        for name in network.inputs
        if name.endswith("_in") and name != network.observation
    }
    return {name: output for name, output in pairs.items() if output in network.outputs}
