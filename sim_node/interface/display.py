"""What ROS tools show: the base as odometry and transform, and the shapes as markers."""

import numpy as np
from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher

from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from msgs_config.messages import topics
from msgs_config.messages.joint_state import make_header, make_vector
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WORLD
from sim_node.interface.markers import MarkerEncoder
from sim_node.physics.simulated_character import SimulatedCharacter

try:  # a full ROS install has it, the wheels have not
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


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
            self._odometry.publish(self._describe_odometry(origin, turn))
        if self._transforms and transforms:
            header = make_header(self._actor.state.stamp_ns, WORLD)
            transform = TransformStamped(header=header, child_frame_id=self._base)
            transform.transform.translation = make_vector(origin.tolist())
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

    def _describe_odometry(self, origin: FloatArray, turn: FloatArray) -> Odometry:
        """The message; its covariances are not known, which zeros say."""
        state = self._actor.state
        message = Odometry(header=make_header(state.stamp_ns, WORLD), child_frame_id=self._base)
        place, twist = message.pose.pose, message.twist.twist
        place.position.x, place.position.y, place.position.z = origin.tolist()
        place.orientation = _quaternion(turn)
        if self._actor.layout.has_floating_base:
            linear = rotations.rotate(rotations.conjugate(turn), state.velocity[:3])
            twist.linear = make_vector(linear.tolist())
            twist.angular = make_vector(state.velocity[3:6].tolist())
        return message


def _quaternion(xyzw: FloatArray) -> Quaternion:
    x, y, z, w = xyzw.tolist()
    return Quaternion(x=x, y=y, z=z, w=w)
