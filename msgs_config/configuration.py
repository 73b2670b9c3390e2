"""What `~/configuration` says: all that a run depends on, as JSON, so that a bag can repeat it."""

import json
import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character import Character, Loading
from msgs_config.errors import LayoutError, MessageError
from msgs_config.joint_layout import JointLayout, JointType
from msgs_config.parameters import Value, Values
from msgs_config.probe import Probe, read_probe

_PACKAGES = ["actuated_characters", "pybullet", "mujoco-core", "numpy", "ros-jazzy-rclpy"]


def describe(
    character: Character,
    values: Values,
    since_ns: int | None = None,
    probe: Probe | None = None,
    terrain: Loading | None = None,
    actuation: Mapping[str, int | bool] | None = None,
) -> str:
    """The JSON text: the character with its files, the parameters in force, and the versions.

    `since_ns` is the stamp of the last state that was answered with other parameters, if any;
    `probe` and `terrain` are a simulator's, `actuation` a controller's.
    """
    content = {
        "character": character.name,
        "character_file": character.file_text,
        "urdf": character.loading.urdf_text,
        "joints": [
            {"name": joint.name, "type": joint.type.value} for joint in character.layout.joints
        ],
        "effort_limits": [_finite(limit) for limit in character.effort_limits().tolist()],
        "mass": character.mass,
        "terrain_urdf": None if terrain is None else terrain.urdf_text,
        "probe": None if probe is None else probe.content(),
        "actuation": None if actuation is None else dict(actuation),
        "parameters_after_stamp_ns": since_ns,
        "parameters": {name: _finite(value) for name, value in values.items()},
        "versions": {"python": platform.python_version()} | _versions(),
    }
    return json.dumps(content, allow_nan=False)


def _finite(value: Value) -> Value | None:
    """What JSON can say: no limit is null, not infinity."""
    return None if isinstance(value, float) and math.isinf(value) else value


def _versions() -> dict[str, str]:
    versions = {}
    for package in _PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:  # a ROS install has some of them from elsewhere
            versions[package] = "unknown"
    return versions


@dataclass(frozen=True)
class RunConfiguration:
    """What a listener needs to read a simulator's topics."""

    character: str
    layout: JointLayout
    effort_limits: FloatArray  # (b,) N m or N
    mass: float  # kg
    parameters: dict[str, Any]
    probe: Probe | None = None  # absent where another simulator than ours speaks


def parse(text: str) -> RunConfiguration:
    """Read a simulator's `~/configuration`.

    Raises:
        MessageError: the text is not one.
    """
    try:
        content = json.loads(text)
        joints = [(joint["name"], JointType(joint["type"])) for joint in content["joints"]]
        layout, probe = JointLayout(joints), content.get("probe")
        return RunConfiguration(
            character=str(content["character"]),
            layout=layout,
            effort_limits=np.array(
                [np.inf if limit is None else limit for limit in content["effort_limits"]]
            ),
            mass=float(content["mass"]),
            parameters=dict(content["parameters"]),
            probe=None if probe is None else read_probe(probe, layout.size),
        )
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError, LayoutError) as error:
        raise MessageError("not a simulator's configuration") from error
