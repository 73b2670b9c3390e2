"""The newest message of each topic: whatever comes between two looks is never kept.

The subscriptions are best effort: no publisher waits for them, or sends anything again. Only what
is latched, such as modes, needs to be reliable.
"""

from dataclasses import replace

from rclpy.node import Node

from actuated_characters.viewer.drawing.name_tag import mode_of
from actuated_characters.viewer.drawing.sample import CharacterSample
from msgs_config.bus.polling import DirectSubscription
from msgs_config.character.layout import JointLayout
from msgs_config.errors import LayoutError, MessageError
from msgs_config.messages import topics
from msgs_config.messages.cdr import decode_string, read_frame_id
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.projectiles import BallStates, ThrowCodec, decode_balls
from msgs_config.messages.session import ANONYMOUS, read_session
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.topic import Quality, Topic
from msgs_config.messages.wrenches import decode_wrenches

_THROWS = 100  # throws between two looks: as many as an episode can have
_UNUSABLE_MESSAGE = (MessageError, LayoutError)


def unacknowledged(topic: Topic, depth: int = 1) -> Topic:
    """The topic as it is read without any duty of its publisher."""
    return replace(topic, quality=Quality(depth, is_reliable=False))


def _for_display(node: Node, below: str, topic: Topic) -> Topic:
    """A topic below a namespace, throttled unless its publisher has it in full alone."""
    full = replace(topic, name=f"{below}/{topic.name}")
    throttled = full.throttled
    has_full_alone = node.count_publishers(full.name) and not node.count_publishers(throttled.name)
    return full if has_full_alone else throttled


class _Newest:
    """The newest message of a topic that is of one simulator."""

    def __init__(self, node: Node, topic: Topic, session: str) -> None:
        self._messages = DirectSubscription(node, unacknowledged(topic))
        self._session = session
        self.close = self._messages.close

    def take(self) -> bytes | None:
        """The newest message since the last call, None if there is none."""
        newest = None
        while (raw := self._messages.take()) is not None:
            newest = raw
        if newest is None:
            return None
        try:
            session = read_session(read_frame_id(newest))
        except MessageError:
            return None
        return newest if session in (self._session, ANONYMOUS) else None


class CharacterReader:
    """The newest messages of one character, while anybody watches."""

    def __init__(self, node: Node, below: str, layout: JointLayout, session: str) -> None:
        """Subscribe to the topics below a namespace, which begins with `/` or is empty."""
        self.sample = CharacterSample()
        self._layout = layout
        # a decoder for each: it is fast for messages of one form, and a reference has no efforts
        self._state_decoder, self._reference_decoder = JointStateDecoder(), JointStateDecoder()

        def newest(topic: Topic) -> _Newest:
            return _Newest(node, _for_display(node, below, topic), session)

        self._states = newest(topics.JOINT_STATES)
        self._reference = newest(topics.REFERENCE.of(topics.CONTROLLER_NODE))
        self._contacts = newest(topics.CONTACTS)
        self._pushes = newest(topics.APPLIED_WRENCH)
        mode = topics.MODE.of(topics.CONTROLLER_NODE)
        self._modes = DirectSubscription(node, replace(mode, name=f"{below}/{mode.name}"))

    def take(self) -> bool:
        """Take what has come into `sample`; whether there is a newer state."""
        sample = self.sample
        try:
            while (raw := self._modes.take()) is not None:
                sample.mode = mode_of(decode_string(raw))
            if (raw := self._contacts.take()) is not None:
                sample.contacts = decode_wrenches(raw)
            if (raw := self._pushes.take()) is not None:
                sample.pushes = decode_wrenches(raw)
            if (raw := self._reference.take()) is not None:
                arrays = self._reference_decoder.decode(raw)
                sample.reference = state_in_layout(self._layout, arrays).position
            if (raw := self._states.take()) is None:
                return False
            sample.state = state_in_layout(self._layout, self._state_decoder.decode(raw))
        except _UNUSABLE_MESSAGE:
            return False  # it is malformed, which the nodes that use it say
        return True

    def close(self) -> None:
        """End the subscriptions."""
        for each in (self._states, self._reference, self._contacts, self._pushes, self._modes):
            each.close()


class BallReader:
    """Where the balls of one simulator are, and how large."""

    def __init__(self, node: Node, below: str, session: str) -> None:
        """Subscribe to the topics below a simulator's namespace."""
        applied = replace(topics.APPLIED_THROW, name=f"{below}/{topics.APPLIED_THROW.name}")
        self._balls = _Newest(node, _for_display(node, below, topics.THROWN), session)
        self._throws = DirectSubscription(node, unacknowledged(applied, _THROWS))
        self._codec = ThrowCodec()

    def take(self) -> tuple[list[ProjectileThrow], BallStates | None]:
        """The balls released since the last call, and where all are, if any has moved."""
        released = []
        try:
            while (raw := self._throws.take()) is not None:
                released.append(self._codec.decode(raw)[1])
            raw = self._balls.take()
            return released, None if raw is None else decode_balls(raw)
        except _UNUSABLE_MESSAGE:
            return released, None

    def close(self) -> None:
        """End the subscriptions."""
        self._balls.close()
        self._throws.close()
