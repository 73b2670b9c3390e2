"""Sensors of an MJCF file as those of a character's file.

What an accelerometer, a gyro and the orientation measure at one site is an IMU; what touches a site
is felt by its whole link.
"""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from msgs_config.character.mjcf.compiling import CompiledMjcf
from msgs_config.character.mjcf.places import anchor, turn_of
from msgs_config.character.mjcf.robot import Robot
from msgs_config.character.mjcf.shapes import is_touched
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed
from msgs_config.geometry import rotations

_SENSORS = mujoco.mjtSensor
_IMU = {
    int(_SENSORS.mjSENS_ACCELEROMETER): "linear_acceleration",
    int(_SENSORS.mjSENS_GYRO): "angular_velocity",
    int(_SENSORS.mjSENS_FRAMEQUAT): "orientation",
}
_FORCE = {int(_SENSORS.mjSENS_TOUCH): "force"}
_IN_STATES = {
    int(getattr(_SENSORS, f"mjSENS_{name}"))
    for name in ["JOINTPOS", "JOINTVEL", "BALLQUAT", "BALLANGVEL", "ACTUATORFRC", "JOINTACTFRC"]
}
"""What joint states have."""
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
_MOST_LETTERS = 64


def read_sensors(mjcf: CompiledMjcf, robot: Robot) -> dict[str, Any]:
    """The content of the key `sensors` of a character's file."""
    model, found = mjcf.model, dict[str, dict[str, Any]]()
    names: dict[tuple[str, int], str] = {}
    used = set(robot.links.values())
    for sensor in range(model.nsensor):
        kind = _kind(mjcf, robot, sensor)
        if not kind:
            continue
        site = int(model.sensor_objid[sensor])
        if (kind, site) not in names:
            name = _unused(_topic_name(mjcf.name("site", site)), used)
            used.add(name)
            names[kind, site] = name
            found.setdefault(kind, {})[name] = _place(mjcf, robot, site)
        noise = float(model.sensor_noise[sensor])
        if noise > 0.0:
            quantity = (_IMU | _FORCE)[int(model.sensor_type[sensor])]
            own = found[kind][names[kind, site]].setdefault("noise", {})
            own[quantity] = {"stddev": noise}
    return found


def remark_sensors(mjcf: CompiledMjcf, robot: Robot) -> Iterator[LeftOut]:
    """A line for each kind of what is not measured, or otherwise."""
    model = mjcf.model
    left_out: list[str] = []
    touch: list[str] = []
    for sensor in range(model.nsensor):
        kind, name = _kind(mjcf, robot, sensor), mjcf.name("sensor", sensor)
        if kind == "force":
            touch.append(name)
        elif not kind and model.sensor_type[sensor] not in _IN_STATES:
            left_out.append(name)
    if left_out:
        yield LeftOut("sensor", f"left out: sensors ({len(left_out)}): {listed(left_out)}")
    if touch:
        yield LeftOut(
            "sensor",
            f"touch sensors feel what touches their whole link ({len(touch)}): {listed(touch)}",
        )


def _kind(mjcf: CompiledMjcf, robot: Robot, sensor: int) -> str:
    """`imu` or `force`; empty for a sensor that a character does not have."""
    model = mjcf.model
    if int(model.sensor_objtype[sensor]) != _SITE or model.sensor_refid[sensor] >= 0:
        return ""
    body = int(model.site_bodyid[model.sensor_objid[sensor]])
    if body not in robot.links:
        return ""
    if model.sensor_type[sensor] in _IMU:
        return "imu"
    geoms = [g for g in range(model.ngeom) if int(model.geom_bodyid[g]) == body]
    touched = body and any(is_touched(mjcf, geom) for geom in geoms)
    return "force" if model.sensor_type[sensor] in _FORCE and touched else ""


def _place(mjcf: CompiledMjcf, robot: Robot, site: int) -> dict[str, Any]:
    model = mjcf.model
    body = int(model.site_bodyid[site])
    yaw, pitch, roll = rotations.yaw_pitch_roll(
        rotations.matrix(turn_of(model.site_quat[site]))
    ).tolist()
    place = np.array(model.site_pos[site]) - anchor(model, body)
    return {"link": robot.links[body], "xyz": place.tolist(), "rpy": [roll, pitch, yaw]}


def _topic_name(name: str) -> str:
    """A name of letters, digits and underscores, as a topic has."""
    letters = "".join(each if each.isascii() and each.isalnum() else "_" for each in name)
    return f"_{letters}"[:_MOST_LETTERS] if letters[:1].isdigit() else letters[:_MOST_LETTERS]


def _unused(name: str, used: set[str]) -> str:
    """The name, or one that says that it is a sensor's."""
    shorter = name[: _MOST_LETTERS - 10]
    return name if name not in used else _unused(f"{shorter}_sensor", used)
