"""Keys as the text of a file: of keyframes (`controller_node.references.files.keyframes`), or of a
timeline (`controller_node.references.timeline`).
"""

import json
import re
from collections.abc import Sequence

import numpy as np
import yaml

from controller_node.references.files.keyframes import Keyframes
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout, LayoutJoint

_DIGITS = 4  # of values and velocities, rad and m, and these a second
_PLAIN_NAME = re.compile(r"[A-Za-z_]\w*")


def keyframes_text(layout: JointLayout, keyframes: Keyframes, remark: str) -> str:
    """The YAML text of keyframes of a character that stands at its own origin.

    A line is a joint; what does not change from one pose to the next is left out.

    Args:
        layout: The character's.
        keyframes: Times in s, values in rad and m.
        remark: Comment at the top, of one line or several.
    """
    head = [f"interpolation: {'smooth' if keyframes.smooth else 'linear'}"]
    if keyframes.period is not None:
        head += ["loop: true", f"period: {_number(keyframes.period, 6)}"]
    return _text(layout, keyframes, remark, [*head, "keyframes:"], "  - time")


def timeline_text(layout: JointLayout, keyframes: Keyframes, remark: str, character: str) -> str:
    """The YAML text of a timeline with one layer of these poses; else as `keyframes_text`.

    `character` is its name, or the path of its file.
    """
    duration = _number(float(keyframes.times[-1]), 6)
    head = [f"character: {json.dumps(character)}", f"duration: {duration}"]
    head += ["keys:", "  - out: never", "    poses:"]
    return _text(layout, keyframes, remark, head, "      - at")


def _text(
    layout: JointLayout, keyframes: Keyframes, remark: str, head: Sequence[str], item: str
) -> str:
    """The text of a remark, the lines of a head, and a list of poses, each after an item's time."""
    lines = [*(f"# {line}" for line in remark.splitlines()), *head]
    indent = " " * (len(item) - len(item.lstrip(" -")))
    before: FloatArray | None = None
    poses = np.round(keyframes.configurations.position, _DIGITS)
    none = np.full_like(poses, np.nan)
    rates = [
        none if each is None else each for each in (keyframes.velocities, keyframes.accelerations)
    ]
    for time, pose, *own in zip(keyframes.times, poses, *rates, strict=True):
        lines.append(f"{item}: {_number(float(time), 6)}")
        changed = [
            joint
            for joint in layout.joints
            if before is None or (pose[joint.entries] != before[joint.entries]).any()
        ]
        lines += _mapping(f"{indent}pose: ", changed, pose)
        for key, rate in zip(("velocity", "acceleration"), own, strict=True):
            moving = [joint for joint in layout.joints if not np.isnan(rate[joint.entries]).any()]
            if moving:
                lines += _mapping(f"{indent}{key}: ", moving, rate)
        before = pose
    return "\n".join(lines) + "\n"


def _mapping(key: str, joints: Sequence[LayoutJoint], values: FloatArray) -> list[str]:
    """The lines of a mapping of the values (n,) of some joints, each on a line of its own."""
    texts = [
        ", ".join(
            f"{_name(name)}: {_number(float(value), _DIGITS)}"
            for name, value in zip(joint.dof_names, values[joint.entries], strict=True)
        )
        for joint in joints
    ]
    return (f"{key}{{" + f",\n{' ' * (len(key) + 1)}".join(texts) + "}").split("\n")


def _name(name: str) -> str:
    """A name that YAML reads as this text."""
    is_plain = _PLAIN_NAME.fullmatch(name) and yaml.safe_load(name) == name
    return name if is_plain else json.dumps(name)


def _number(value: float, digits: int) -> str:
    """A decimal number without an exponent."""
    text = f"{value + 0.0:.{digits}f}".rstrip("0")
    return text + "0" if text.endswith(".") else text
