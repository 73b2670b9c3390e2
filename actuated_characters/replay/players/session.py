"""What a bag's simulator has said, as said in another session: that of the player in its place."""

import json
from dataclasses import replace

from rclpy.serialization import serialize_message
from std_msgs.msg import Header, String

from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder, decode
from msgs_config.messages.session import episode_text
from msgs_config.messages.wrenches import decode_wrenches, encode_wrenches

_WRENCHES = (topics.CONTACTS.name, topics.APPLIED_WRENCH.name)


class NewSession:
    """Names a session in serialised messages; their numbers stay the same to the bit."""

    def __init__(self, session: str) -> None:
        self._session = session
        self._decoder = JointStateDecoder()
        self._encoders: dict[tuple[str, ...], JointStateEncoder] = {}

    def state(self, raw: bytes) -> bytes:
        """A state.

        Raises:
            MessageError: the bytes are none.
        """
        found = self._decoder.decode(raw)
        encoder = self._encoders.get(found.names)
        if encoder is None:
            encoder = self._encoders[found.names] = JointStateEncoder(found.names, self._session)
        return encoder.encode(found.stamp_ns, found.position, found.velocity, found.effort)

    def beside_state(self, topic: str, raw: bytes) -> bytes:
        """A message of a topic that comes with a state; one that names no session is the same.

        Raises:
            MessageError: the bytes are no such message.
        """
        if topic not in _WRENCHES:
            return raw
        return encode_wrenches(replace(decode_wrenches(raw), frame_id=self._session))

    def episode(self, raw: bytes) -> bytes:
        """A message on `episode`; older bags name no session there.

        Raises:
            MessageError: the bytes are none.
        """
        header = decode(raw, Header)
        number = header.frame_id.partition(" ")[0]
        header.frame_id = episode_text(int(number) if number.isdecimal() else 1, self._session)
        return bytes(serialize_message(header))

    def configuration(self, raw: bytes) -> bytes:
        """A simulator's `~/configuration`.

        Raises:
            MessageError: the bytes are no text.
        """
        content = json.loads(decode(raw, String).data)
        text = json.dumps({**content, "session": self._session}, allow_nan=False)
        return bytes(serialize_message(String(data=text)))
