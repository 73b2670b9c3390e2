"""Lets the messages of one simulator through to a recording, and drops those of others."""

import json
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from actuated_characters.recorder.topics import RecordedTopic
from msgs_config.errors import MessageError
from msgs_config.messages import topics
from msgs_config.messages.cdr import decode_string, read_frame_id
from msgs_config.messages.session import (
    ANONYMOUS,
    ForeignSessions,
    episode_session,
    read_session,
)
from msgs_config.messages.topic import SessionPlace

_MOST_HELD = 1000  # messages before the first state


class Heard(NamedTuple):
    """A message as the recorder has taken it."""

    recorded: RecordedTopic
    raw: bytes
    published_ns: int


def find_session(message: Heard) -> str | None:
    """Return the session that a message is of; None if it may be of any."""
    place = message.recorded.topic.session
    try:
        match place:
            case SessionPlace.FRAME_ID:
                return read_session(read_frame_id(message.raw))
            case SessionPlace.FRAME_ID_IF_ANY:
                return read_session(read_frame_id(message.raw)) or None
            case SessionPlace.EPISODE:
                return episode_session(read_frame_id(message.raw))
            case SessionPlace.CONFIGURATION:
                return read_session(str(json.loads(decode_string(message.raw))["session"]))
            case SessionPlace.NOWHERE:
                return None
    except (MessageError, ValueError, KeyError, TypeError, RecursionError):
        return None if place is SessionPlace.FRAME_ID_IF_ANY else ANONYMOUS


class SessionFilter:
    """Belongs to the session that is given, or to the first whose state comes, and to no other.

    Messages of others are dropped and counted; messages before the first state are held until then.
    On a busy machine that may be long: a topic can be heard seconds after the others. Too many are
    held as the middleware would: what is latched stays, for it comes once, and the oldest go.
    """

    def __init__(self, given: str, tell: Callable[[str], None]) -> None:
        """`tell` gets a line for each session that is dropped."""
        self.bound: str | None = given or None
        self._foreign = ForeignSessions()
        self._tell = tell
        self._pending: deque[tuple[str, Heard]] = deque()

    def dropped(self, topic: str) -> int:
        """How many messages of a topic, by its name in the bag, were dropped."""
        return self._foreign.counts[topic]

    def take(self, message: Heard) -> list[Heard]:
        """The messages to record now that this one has come, in their order."""
        session = find_session(message)
        if session is None:
            return [message]
        if self.bound is None and message.recorded.own_name == topics.JOINT_STATES.name:
            return [*self._bind(session), message]
        if self.bound is None:
            self._hold(session, message)
            return []
        if session != self.bound:
            self._drop(session, message)
            return []
        return [message]

    def finish(self) -> list[Heard]:
        """The rest to record at the end: that of the only simulator, if it had no state yet."""
        sessions = {session for session, _ in self._pending}
        return self._bind(sessions.pop()) if len(sessions) == 1 else []

    def _hold(self, session: str, message: Heard) -> None:
        self._pending.append((session, message))
        if len(self._pending) > _MOST_HELD:
            latched = (each.recorded.topic.quality.is_latched for _, each in self._pending)
            oldest = next((at for at, is_latched in enumerate(latched) if not is_latched), 0)
            del self._pending[oldest]

    def _bind(self, session: str) -> list[Heard]:
        self.bound = session
        own = [message for of, message in self._pending if of == session]
        for of, message in self._pending:
            if of != session:
                self._drop(of, message)
        self._pending.clear()
        return own

    def _drop(self, session: str, message: Heard) -> None:
        line = self._foreign.reject(message.recorded.name, session, self.bound)
        if line is not None:
            self._tell(line)
