"""The publishers of what ROS' tools show of one character; a controller needs none of it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.bus.node import BusNode, Publisher
from msgs_config.bus.publishing import has_subscribers
from msgs_config.character.urdf.described_joints import DescribedJoints
from msgs_config.character.urdf.robot_description import robot_description
from msgs_config.character.urdf.ros2_control import with_ros2_control
from msgs_config.geometry import fixed_order, rotations, scalars
from msgs_config.messages import topics
from msgs_config.messages.cdr import DoublesEncoder, encode_string
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.topic import Topic
from sim_node.interface.markers import MarkerEncoder
from sim_node.interface.transforms import TransformPublisher
from sim_node.node_settings import NodeSettings
from sim_node.physics.simulated_character import SimulatedCharacter

_ODOMETRY_DOUBLES = 85  # position, orientation, 36 of a covariance, twist, 36 of a covariance
_POSITION, _ORIENTATION = slice(0, 3), slice(3, 7)
_LINEAR, _ANGULAR = slice(43, 46), slice(46, 49)
_VARIANCES = np.concatenate((7 + 7 * np.arange(6), 49 + 7 * np.arange(6)))
_EXACT_VARIANCE = 1e-9  # m^2, rad^2 or their rates': a zero would mean that it is unknown


def _describe(node: BusNode, character: SimulatedCharacter, settings: NodeSettings) -> str:
    """The character's URDF, with a tag of ros2_control if it is asked for."""
    whole, name = character.setup.character, character.setup.name
    description = robot_description(whole, settings.frames.base)
    if not settings.ros2_control:
        return description
    states, commands = (
        node.resolve_topic_name(topic.under(name).name)
        for topic in (topics.ROBOT_JOINT_STATES, topics.ROBOT_JOINT_COMMANDS)
    )
    return with_ros2_control(description, whole, settings.ros2_control, states, commands)


class _WrenchPublisher(NamedTuple):
    """The publisher of a link's contact wrench."""

    link: int
    publisher: Publisher
    encoder: DoublesEncoder


class DisplayPublishers:
    """Base, frames, joints of the description, shapes and contacts. All but the base are samples.

    A topic without subscribers costs nothing.
    """

    def __init__(
        self, node: BusNode, character: SimulatedCharacter, settings: NodeSettings
    ) -> None:
        """Offer the topics, below the character's name, and publish what never changes."""
        self._character = character
        self._ticks = settings.display_ticks
        self.wants_contacts = False
        """Whether a contact wrench has a subscriber, when the last sample was published."""

        def create(topic: Topic) -> Publisher:
            return node.publisher(topic.under(character.setup.name))

        whole, prefix = character.character, character.setup.prefix
        self._joints = DescribedJoints(whole, settings.frames.base)
        self._odometry = create(topics.ODOM)
        self._visualization = create(topics.VISUALIZATION)
        self._joint_states = create(topics.DESCRIPTION_JOINT_STATES)
        self._description = create(topics.ROBOT_DESCRIPTION)
        self._description.publish(encode_string(_describe(node, character, settings)))
        self._wrenches = list(self._make_wrenches(create))
        self._transforms: TransformPublisher | None = None
        if topics.TF.is_installed:
            self._transforms = TransformPublisher(node, character, self._joints, settings.frames)
        self._odometry_encoder = DoublesEncoder(
            prefix + settings.frames.odom, prefix + self._joints.root
        )
        self._odometry_doubles = np.zeros(_ODOMETRY_DOUBLES)
        self._odometry_doubles[_VARIANCES] = _EXACT_VARIANCE
        x, y, z, w = self._joints.turn_xyzw.tolist()
        self._into_link = scalars.conjugate((x, y, z, w))
        self._link_in_base = scalars.axes((x, y, z, w))
        self._joint_encoder = JointStateEncoder([joint.name for joint in self._joints.moving])
        self._markers = MarkerEncoder(whole)

    def _make_wrenches(self, create: Callable[[Topic], Publisher]) -> Iterator[_WrenchPublisher]:
        """A publisher for each link that can be touched, on a topic of the link's name."""
        taken: set[str] = set()
        for index, link in enumerate(self._character.character.links):
            if not link.collision_shapes:
                continue
            topic = topics.contact_wrench(link.name)
            while topic.name in taken:
                topic = replace(topic, name=f"{topic.name}_")
            taken.add(topic.name)
            frame = self._character.setup.prefix + link.name
            yield _WrenchPublisher(index, create(topic), DoublesEncoder(frame))

    def publish(self, tick: int) -> None:
        """Publish what shows a tick's state."""
        if has_subscribers(self._odometry):
            self._odometry.publish(self._encode_odometry())
        if tick % self._ticks == 0 or self._character.state.effort is None:
            self._publish_sample()

    def republish(self) -> None:
        """Publish the markers again, and the rest for those who are new."""
        self._publish_markers()
        if self._transforms is not None:
            self._transforms.repeat(self._character.state.stamp_ns, self._positions)

    @property
    def streams(self) -> Sequence[Publisher]:
        """The publishers of what comes again and again."""
        wrenches = [each.publisher for each in self._wrenches]
        frames = [] if self._transforms is None else [self._transforms.publisher]
        return [self._odometry, self._visualization, self._joint_states, *wrenches, *frames]

    def _publish_sample(self) -> None:
        self._publish_markers()
        stamp_ns = self._character.state.stamp_ns
        if has_subscribers(self._joint_states):
            self._joint_states.publish(self._joint_encoder.encode(stamp_ns, self._positions()))
        if self._transforms is not None:
            self._transforms.publish(stamp_ns, self._positions)
        self._publish_wrenches()

    def _positions(self) -> FloatArray:
        return self._joints.positions(self._character.state.position)

    def _publish_wrenches(self) -> None:
        """Publish the wrench on each link that is listened to, in its frame, about its origin."""
        heard = [each for each in self._wrenches if has_subscribers(each.publisher)]
        self.wants_contacts = bool(heard)
        contacts = self._character.contacts
        if contacts is None or not heard:
            return
        _, turns = self._character.link_frames()
        for index, publisher, encoder in heard:
            centre = np.array(self._character.character.links[index].inertial_pose.position)
            back = rotations.conjugate(turns[index])
            force, torque = rotations.rotate(back, contacts.wrenches[index].reshape(2, 3))
            wrench = np.concatenate((force, torque + fixed_order.cross(centre, force)))
            publisher.publish(encoder.encode(self._character.state.stamp_ns, wrench))

    def _encode_odometry(self) -> bytes:
        """The base in the frame of `odom`, its twist in its own."""
        origin, turn = self._character.base_frame()
        base_turn = scalars.multiply(turn.tolist(), self._into_link)
        values = self._odometry_doubles
        values[_POSITION], values[_ORIENTATION] = origin, base_turn
        if self._character.layout.has_floating_base:
            velocity = self._character.state.velocity.tolist()
            into_base = scalars.axes(scalars.conjugate(base_turn))
            values[_LINEAR] = scalars.to_parent(into_base, velocity[:3])
            values[_ANGULAR] = scalars.to_parent(self._link_in_base, velocity[3:6])
        return self._odometry_encoder.encode(self._character.state.stamp_ns, values)

    def _publish_markers(self) -> None:
        """Publish the shapes and the world's balls where they are, if there are subscribers."""
        if has_subscribers(self._visualization):
            balls = self._character.balls
            origins, turns = self._character.link_frames()
            self._visualization.publish(
                self._markers.encode(
                    self._character.state.stamp_ns, origins, turns, balls.throws, balls.motion()
                )
            )
