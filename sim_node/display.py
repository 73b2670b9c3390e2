"""What ROS tools show: the base as odometry and transform, and the shapes as markers."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from msgs_config import rotations, topics
from msgs_config.arrays import FloatArray
from msgs_config.character import Shape, ShapeType
from msgs_config.messages import split_stamp
from msgs_config.wrench_messages import WORLD
from sim_node.actor import Actor

try:  # a full ROS install has it, the wheels have not
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

_TYPES = {
    ShapeType.BOX: Marker.CUBE,
    ShapeType.SPHERE: Marker.SPHERE,
    ShapeType.CYLINDER: Marker.CYLINDER,
    ShapeType.MESH: Marker.MESH_RESOURCE,
}


class Display:
    """Publishes `odom`, `visualization` and, where there is `tf2_msgs`, `/tf`."""

    def __init__(self, node: Node, actor: Actor, namespace: str) -> None:
        self._actor = actor
        self._base = actor.role.prefix + actor.character.links[0].name
        self._odometry = topics.create_publisher(node, topics.ODOM.under(namespace))
        self._visualization = topics.create_publisher(node, topics.VISUALIZATION.under(namespace))
        self._transforms = None
        if TFMessage is not None:
            self._transforms = node.create_publisher(TFMessage, "/tf", topics.STREAM_QOS)
        self._parts = [
            (row, part, _marker(number, part)) for number, (row, part) in enumerate(_parts(actor))
        ]

    def publish_base(self) -> None:
        """Publish the base link's pose and twist, if anybody listens."""
        odometry = self._odometry.get_subscription_count()
        transforms = self._transforms and self._transforms.get_subscription_count()
        if not (odometry or transforms):
            return
        origins, turns = self._actor.link_frames()
        header = self._header()
        if odometry:
            self._odometry.publish(self._odometry_message(header, origins[0], turns[0]))
        if self._transforms and transforms:
            transform = TransformStamped(header=header, child_frame_id=self._base)
            transform.transform.translation = _vector(origins[0])
            transform.transform.rotation = _quaternion(turns[0])
            self._transforms.publish(TFMessage(transforms=[transform]))

    def publish_markers(self) -> None:
        """Publish the shapes where they are now, if anybody listens."""
        if not self._visualization.get_subscription_count():
            return
        origins, turns = self._actor.link_frames()
        header = self._header()
        for row, part, marker in self._parts:
            marker.header = header
            offset = np.array(part.pose.position)
            marker.pose = Pose(
                position=_point(origins[row] + rotations.rotate(turns[row], offset)),
                orientation=_quaternion(
                    rotations.multiply(turns[row], np.array(part.pose.orientation_xyzw))
                ),
            )
        self._visualization.publish(MarkerArray(markers=[marker for _, _, marker in self._parts]))

    def _header(self) -> Header:
        seconds, nanoseconds = split_stamp(self._actor.state.stamp_ns)
        return Header(stamp=Time(sec=seconds, nanosec=nanoseconds), frame_id=WORLD)

    def _odometry_message(self, header: Header, origin: FloatArray, turn: FloatArray) -> Odometry:
        message = Odometry(header=header, child_frame_id=self._base)
        message.pose.pose = Pose(position=_point(origin), orientation=_quaternion(turn))
        if self._actor.layout.has_floating_base:
            velocity = self._actor.state.velocity
            in_base = rotations.rotate(rotations.conjugate(turn), velocity[:3])
            message.twist.twist.linear = _vector(in_base)
            message.twist.twist.angular = _vector(velocity[3:6])
        return message


def _parts(actor: Actor) -> Iterator[tuple[int, Shape]]:
    """Every shape with its link's row; a capsule as a cylinder and two spheres."""
    for row, link in enumerate(actor.character.links):
        for shape in link.shapes:
            for part in shape.without_capsule():
                yield row, part


def _marker(number: int, shape: Shape) -> Marker:
    red, green, blue, alpha = shape.color_rgba
    marker = Marker(type=_TYPES[shape.type], id=number, scale=_scale(shape))
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=alpha)
    if shape.mesh:
        marker.mesh_resource = Path(shape.mesh).as_uri()
        marker.mesh_use_embedded_materials = True
    return marker


def _scale(shape: Shape) -> Vector3:
    """A marker's edges or diameters."""
    if shape.type is ShapeType.SPHERE:
        return _vector(np.full(3, 2.0 * shape.size[0]))
    if shape.type is ShapeType.CYLINDER:
        radius, length = shape.size
        return _vector(np.array((2.0 * radius, 2.0 * radius, length)))
    return _vector(np.array(shape.size))


def _vector(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)


def _point(values: FloatArray) -> Point:
    x, y, z = values.tolist()
    return Point(x=x, y=y, z=z)


def _quaternion(xyzw: FloatArray) -> Quaternion:
    x, y, z, w = xyzw.tolist()
    return Quaternion(x=x, y=y, z=z, w=w)
