"""Bags of other robots, as `ros2 bag record` leaves them, written by the package rosbags."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_JAZZY)
START_NS = 1_700_000_000_000_000_000

ROLLER = """\
<robot name="roller">
  <link name="base_footprint"/>
  <joint name="base" type="fixed">
    <parent link="base_footprint"/><child link="base_link"/><origin xyz="0 0 0.25"/>
  </joint>
  <link name="base_link">
    <inertial><mass value="5"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><box size="0.6 0.4 0.2"/></geometry></visual>
    <collision><geometry><box size="0.6 0.4 0.5"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base_link"/><child link="arm"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="5"/>
  </joint>
  <link name="arm">
    <inertial><origin xyz="0 0 0.2"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="0 0 0.2"/><geometry><box size="0.05 0.05 0.4"/></geometry></visual>
  </link>
  <joint name="finger" type="prismatic">
    <parent link="arm"/><child link="tip"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.1" effort="10" velocity="5"/>
  </joint>
  <link name="tip">
    <inertial><mass value="0.2"/>
      <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><sphere radius="0.05"/></geometry></visual>
  </link>
  <joint name="wheel" type="continuous">
    <parent link="base_link"/><child link="tyre"/><origin xyz="0 0.25 -0.15"/><axis xyz="0 1 0"/>
  </joint>
  <link name="tyre">
    <inertial><mass value="0.5"/>
      <inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><sphere radius="0.1"/></geometry></visual>
  </link>
</robot>
"""
"""A base that rolls, an arm, a slider and a wheel; its root has no mass of its own."""

JOINTS = ("shoulder", "finger", "wheel")


class Sent(NamedTuple):
    """A message on a topic, and when it is logged."""

    topic: str
    log_time_ns: int
    message: Any


def at(seconds: float) -> int:
    """A time in s since the start of the robot's bag, ns of wall time."""
    return START_NS + round(1e9 * seconds)


def make(kind: str, **fields: Any) -> Any:
    """A message of a type such as `geometry_msgs/msg/Pose`."""
    return TYPES.types[kind](**fields)


def header(stamp_ns: int, frame: str = "") -> Any:
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    stamp = make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def joints(
    seconds: float,
    names: Sequence[str],
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    *,
    topic: str = "/joint_states",
    stamp_ns: int | None = None,
    late: float = 0.002,
) -> Sent:
    """Joint states at a time, logged a moment later."""
    message = make(
        "sensor_msgs/msg/JointState",
        header=header(at(seconds) if stamp_ns is None else stamp_ns),
        name=list(names),
        position=np.array(position, dtype=np.float64),
        velocity=np.array(velocity, dtype=np.float64),
        effort=np.array(effort, dtype=np.float64),
    )
    return Sent(topic, at(seconds + late), message)


def _vector(values: Sequence[float], kind: str) -> Any:
    return make(kind, **dict(zip("xyz", map(float, values), strict=True)))


def _turn(yaw: float) -> Any:
    half = 0.5 * yaw
    return make(
        "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(np.sin(half)), w=float(np.cos(half))
    )


def pose(place: Sequence[float], yaw: float) -> Any:
    point = _vector(place, "geometry_msgs/msg/Point")
    return make("geometry_msgs/msg/Pose", position=point, orientation=_turn(yaw))


def transform(
    seconds: float,
    parent: str,
    child: str,
    place: Sequence[float],
    yaw: float = 0.0,
    *,
    topic: str = "/tf",
) -> Sent:
    moved = make(
        "geometry_msgs/msg/Transform",
        translation=_vector(place, "geometry_msgs/msg/Vector3"),
        rotation=_turn(yaw),
    )
    stamped = make(
        "geometry_msgs/msg/TransformStamped",
        header=header(at(seconds), parent),
        child_frame_id=child,
        transform=moved,
    )
    message = make("tf2_msgs/msg/TFMessage", transforms=[stamped])
    return Sent(topic, at(seconds + 0.001), message)


def odometry(
    seconds: float,
    child: str,
    place: Sequence[float],
    yaw: float = 0.0,
    *,
    topic: str = "/odom",
    stamp_ns: int | None = None,
) -> Sent:
    zero = _vector((0, 0, 0), "geometry_msgs/msg/Vector3")
    still = make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
    nothing = np.zeros(36)
    message = make(
        "nav_msgs/msg/Odometry",
        header=header(at(seconds) if stamp_ns is None else stamp_ns, "odom"),
        child_frame_id=child,
        pose=make(
            "geometry_msgs/msg/PoseWithCovariance", pose=pose(place, yaw), covariance=nothing
        ),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=still, covariance=nothing),
    )
    return Sent(topic, at(seconds + 0.001), message)


def stamped_pose(
    seconds: float, place: Sequence[float], yaw: float = 0.0, *, topic: str = "/pose"
) -> Sent:
    message = make(
        "geometry_msgs/msg/PoseStamped", header=header(at(seconds), "map"), pose=pose(place, yaw)
    )
    return Sent(topic, at(seconds + 0.001), message)


def text(topic: str, content: str) -> Sent:
    return Sent(topic, at(0.0), make("std_msgs/msg/String", data=content))


def write_bag(
    bag: Path,
    sent: Iterable[Sent],
    storage: StoragePlugin = StoragePlugin.MCAP,
    version: int = 9,
) -> Path:
    """A rosbag2 directory of these messages, in the order in which they are logged."""
    with Writer(bag, version=version, storage_plugin=storage) as writer:  # type: ignore[arg-type]
        connections: dict[str, Any] = {}
        for topic, log_time_ns, message in sorted(sent, key=lambda each: each.log_time_ns):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(connections[topic], log_time_ns, TYPES.serialize_cdr(message, kind))
    return bag
