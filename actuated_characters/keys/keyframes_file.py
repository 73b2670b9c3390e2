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
from msgs_config.character.layout import JointLayout

_DIGITS = 4  # of values, rad and m
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
    for time, pose in zip(keyframes.times, keyframes.configurations.position, strict=True):
        lines.append(f"{item}: {_number(float(time), 6)}")
        joints = _joints(layout, pose, before)
        lines.append(f"{indent}pose: {{" + f",\n{indent}       ".join(joints) + "}")
        before = pose
    return "\n".join(lines) + "\n"


def _joints(layout: JointLayout, pose: FloatArray, before: FloatArray | None) -> list[str]:
    """A text for each joint, or each vector of the root, that is not what it was before."""
    texts = []
    for joint in layout.joints:
        for entries in joint.vectors:
            values = np.round(pose[entries], _DIGITS)
            if before is None or (values != np.round(before[entries], _DIGITS)).any():
                names = layout.dof_names[entries]
                texts.append(
                    ", ".join(
                        f"{_name(name)}: {_number(float(value), _DIGITS)}"
                        for name, value in zip(names, values, strict=True)
                    )
                )
    return texts


def _name(name: str) -> str:
    """A name that YAML reads as this text."""
    is_plain = _PLAIN_NAME.fullmatch(name) and yaml.safe_load(name) == name
    return name if is_plain else json.dumps(name)


def _number(value: float, digits: int) -> str:
    """A decimal number without an exponent."""
    text = f"{value + 0.0:.{digits}f}".rstrip("0")
    return text + "0" if text.endswith(".") else text
