"""What the simulator publishes, tick by tick, in the contract's order."""

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Header, String

from msgs_config import topics
from msgs_config.joint_layout import JointLayout
from msgs_config.messages import JointStateEncoder, encode_clock, split_stamp
from msgs_config.stamped import StampedState


class Outputs:
    """The simulator's publishers. Within a tick the state comes last."""

    def __init__(self, node: Node, layout: JointLayout) -> None:
        self._encoder = JointStateEncoder(layout.dof_names)
        self._clock = topics.create_publisher(node, topics.CLOCK)
        self._episode = topics.create_publisher(node, topics.EPISODE)
        self._configuration = topics.create_publisher(node, topics.CONFIGURATION)
        self._states = topics.create_publisher(node, topics.JOINT_STATES)
        self._last_state = b""

    @property
    def state_subscribers(self) -> int:
        """How many subscribe to the states."""
        return int(self._states.get_subscription_count())

    def publish_configuration(self, text: str) -> None:
        """Publish the JSON text that a bag needs to repeat the run."""
        self._configuration.publish(String(data=text))

    def publish_episode(self, number: int, stamp_ns: int) -> None:
        """Publish that an episode begins with the state of this stamp."""
        seconds, nanoseconds = split_stamp(stamp_ns)
        stamp = Time(sec=seconds, nanosec=nanoseconds)
        self._episode.publish(Header(stamp=stamp, frame_id=str(number)))

    def publish_state(self, state: StampedState) -> None:
        """Publish a tick: the clock, then the state."""
        effort = () if state.effort is None else (state.effort,)
        self._last_state = self._encoder.encode(
            state.stamp_ns, state.position, state.velocity, *effort
        )
        self._clock.publish(encode_clock(state.stamp_ns))
        self._states.publish(self._last_state)

    def republish_state(self) -> None:
        """Publish the last state again, the same bytes."""
        self._states.publish(self._last_state)

    def flush(self, seconds: float) -> bool:
        """Wait until every subscriber has the last tick, at the most `seconds`; whether it has."""
        streams = (self._clock, self._states)
        return all(stream.wait_for_all_acked(Duration(seconds=seconds)) for stream in streams)
