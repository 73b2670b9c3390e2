"""What ROS tools show: the base as odometry and transform, and the shapes as markers."""

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Header

from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from msgs_config.messages import topics
from msgs_config.messages.joint_state import DoublesEncoder, split_stamp
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WORLD
from sim_node.interface.markers import MarkerEncoder
from sim_node.physics.simulated_character import SimulatedCharacter

try:  # a full ROS install has it, the wheels have not
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

_ODOMETRY_DOUBLES = 85  # position, orientation, 36 of a covariance, twist, 36 of a covariance
_POSITION, _ORIENTATION = slice(0, 3), slice(3, 7)
_LINEAR, _ANGULAR = slice(43, 46), slice(46, 49)


class Display:
    """Publishes `odom`, `visualization` and, where there is `tf2_msgs`, `/tf`."""

    def __init__(self, node: Node, actor: SimulatedCharacter, namespace: str) -> None:
        self._actor = actor
        self._base = actor.role.prefix + actor.character.links[0].name
        self._odometry = topics.create_publisher(node, topics.ODOM.under(namespace))
        self._visualization = topics.create_publisher(node, topics.VISUALIZATION.under(namespace))
        self._transforms = None
        if TFMessage is not None:
            self._transforms = node.create_publisher(TFMessage, "/tf", topics.STREAM_QOS)
        self._odometry_encoder = DoublesEncoder(WORLD, self._base)
        self._throws: tuple[ProjectileThrow, ...] = ()  # whose balls are shown
        self._markers = MarkerEncoder(actor.character)

    @property
    def publishers(self) -> list[Publisher]:
        """All that it publishes on."""
        every = (self._odometry, self._visualization, self._transforms)
        return [publisher for publisher in every if publisher is not None]

    def publish_base(self) -> None:
        """Publish the base link's pose and twist, if anybody listens."""
        odometry = self._odometry.get_subscription_count()
        transforms = self._transforms and self._transforms.get_subscription_count()
        if not (odometry or transforms):
            return
        origin, turn = self._actor.base_frame()
        if odometry:
            self._odometry.publish(self._encode_odometry(origin, turn))
        if self._transforms and transforms:
            transform = TransformStamped(header=self._header(), child_frame_id=self._base)
            transform.transform.translation = _vector(origin)
            transform.transform.rotation = _quaternion(turn)
            self._transforms.publish(TFMessage(transforms=[transform]))

    def publish_markers(self) -> None:
        """Publish the shapes and the world's balls where they are now, if anybody listens."""
        if not self._visualization.get_subscription_count():
            return
        balls = self._actor.balls
        if balls.throws != self._throws:
            gone = max(len(self._throws) - len(balls.throws), 0)
            self._markers = MarkerEncoder(self._actor.character, balls.throws, gone)
            self._throws = balls.throws
        origins, turns = self._actor.link_frames()
        if balls.throws:
            motion = balls.motion()
            origins = np.concatenate((origins, motion[:, :3]))
            turns = np.concatenate((turns, motion[:, 3:7]))
        self._visualization.publish(
            self._markers.encode(self._actor.state.stamp_ns, origins, turns)
        )
        if self._markers.takes_away:  # once is enough
            self._markers = MarkerEncoder(self._actor.character, self._throws)

    def _header(self) -> Header:
        seconds, nanoseconds = split_stamp(self._actor.state.stamp_ns)
        return Header(stamp=Time(sec=seconds, nanosec=nanoseconds), frame_id=WORLD)

    def _encode_odometry(self, origin: FloatArray, turn: FloatArray) -> bytes:
        """The serialised message; its covariances are not known, which zeros say."""
        values = np.zeros(_ODOMETRY_DOUBLES)
        values[_POSITION], values[_ORIENTATION] = origin, turn
        if self._actor.layout.has_floating_base:
            velocity = self._actor.state.velocity
            values[_LINEAR] = rotations.rotate(rotations.conjugate(turn), velocity[:3])
            values[_ANGULAR] = velocity[3:6]
        return self._odometry_encoder.encode(self._actor.state.stamp_ns, values)


def _vector(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)


def _quaternion(xyzw: FloatArray) -> Quaternion:
    x, y, z, w = xyzw.tolist()
    return Quaternion(x=x, y=y, z=z, w=w)
