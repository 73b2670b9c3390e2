"""Which running simulator a message is of, and to which one a receiver belongs. No ROS in here.

A session id names one run of one simulator: its node's full name, `#`, and some digits. No name in
ROS has a `#`; a `frame_id` that is no session id names no session.
"""

import re
import secrets
from collections import Counter
from collections.abc import Callable
from functools import lru_cache

from msgs_config.errors import ConfigurationError
from msgs_config.settings import Settings, parameter


class GivenSession(Settings):
    """The session that a node is given. Raises ConfigurationError if it is no session id."""

    id: str = parameter(
        "",
        "id of the one simulator that this node is or belongs to, NAME#DIGITS; empty: sim_node "
        "makes one, and others bind to the first simulator whose states they can use",
        name="session",
    )

    def __post_init__(self) -> None:
        if self.id and not is_session(self.id):
            raise ConfigurationError(
                f"parameter 'session' is {self.id!r}; it must be a node's full name, '#' and "
                "letters or digits, such as /sim_node#3fa29c01b7de, or empty"
            )


(SESSION,) = GivenSession.declared()
ANONYMOUS = ""
"""The session of all messages that name none."""

SILENT_AND_ALONE, SILENT = 1.0, 3.0  # s
"""How long a simulator says nothing, while another one speaks, before it is taken to have ended:
where at most one node publishes states, and where several do. A simulator that waits for commands,
or is not alone, speaks each `republish_period`."""

REMEDY = "give each simulator a ROS_DOMAIN_ID or its own namespace"

_MARK = "#"
_FORM = re.compile(r"[A-Za-z0-9_/]{1,255}#[0-9A-Za-z]{1,40}")
_LONGEST_LOOK = 0.1  # s of silence that one look can count
_MOST_NAMED = 8  # foreign sessions


def make_session(node_name: str) -> str:
    """A new id for a simulator whose node has this full name. It influences no state."""
    return f"{node_name}{_MARK}{secrets.token_hex(6)}"


def is_session(text: str) -> bool:
    """Whether a text, such as a `frame_id`, names a session."""
    return _MARK in text and _FORM.fullmatch(text) is not None


@lru_cache(maxsize=64)  # every message names one, mostly the same
def read_session(frame_id: str) -> str:
    """The session that a `frame_id` names, else `ANONYMOUS`."""
    return frame_id if is_session(frame_id) else ANONYMOUS


def episode_text(number: int, session: str) -> str:
    """The `frame_id` of a message on `episode`."""
    return f"{number} {session}".rstrip()


def episode_session(frame_id: str) -> str:
    """The session that the `frame_id` of a message on `episode` names, else `ANONYMOUS`."""
    return read_session(frame_id.partition(" ")[2])


def named(session: str | None) -> str:
    """A session as a sentence has it."""
    if session is None:
        return "not known yet"
    return session or "that of a simulator that names none"


class SessionBinding:
    """Binds a receiver to the session of one simulator, and releases it when that has ended.

    Silence counts from the first state of another session on, and while the receiver looks: the
    time in which its process stands still does not count, for what was said then is yet to be
    taken.
    """

    def __init__(self, given: str, count_publishers: Callable[[], int]) -> None:
        """Bind to a session that was given for good, or without one to the first that is taken.

        `count_publishers` says how many nodes publish states; asked only where it decides.
        """
        self.bound: str | None = given or None
        self._is_given = bool(given)
        self._count_publishers = count_publishers
        self._silence: float | None = None  # s; None before another session speaks
        self._looked_at: float | None = None

    def note_look(self, now: float) -> None:
        """Note, at every turn, that the receiver looks for messages; `now` in s."""
        if self._looked_at is not None and self._silence is not None:
            self._silence += min(max(now - self._looked_at, 0.0), _LONGEST_LOOK)
        self._looked_at = now

    def hear(self, session: str) -> bool:
        """Note a message of a session; returns whether it is the bound one."""
        if session != self.bound:
            return False
        self._silence = None
        return True

    def admits(self, session: str) -> bool:
        """Whether a state of a session may be taken: any while none is bound, else the bound one's.

        The bound one is released first if it has ended.
        """
        if self.hear(session):
            return True
        if self.bound is not None and not self._is_given and self._has_ended():
            self.bound = None
        if self._silence is None:
            self._silence = 0.0
        return self.bound is None

    def take(self, session: str) -> bool:
        """Take a usable state of a session that was admitted; whether that binds a new one."""
        is_new = self.bound is None
        if is_new:
            self.bound = session
        self.hear(session)
        return is_new

    def release(self) -> bool:
        """Be bound to none again, unless the session was given; whether that is so."""
        if not self._is_given:
            self.bound = None
        return not self._is_given

    def _has_ended(self) -> bool:
        if self._silence is None or self._silence < SILENT_AND_ALONE:
            return False
        return self._silence >= SILENT or self._count_publishers() <= 1


class ForeignSessions:
    """Counts what was rejected because it is of another session, and names each such session once.

    The number of those that are named is bounded: a sender may make up any number of them.
    """

    def __init__(self) -> None:
        self.counts = Counter[str]()  # by topic
        self._named = set[str]()

    def reject(self, topic: str, session: str, own: str | None) -> str | None:
        """Count a message on a topic; returns the line to log, if there is a new one."""
        self.counts[topic] += 1
        if session in self._named or len(self._named) > _MOST_NAMED:
            return None
        self._named.add(session)
        if len(self._named) > _MOST_NAMED:
            return f"rejected messages of more than {_MOST_NAMED} other sessions; no more are named"
        return (
            f"rejected '{topic}': its session is {named(session)}, this node's is {named(own)}; "
            f"{REMEDY}"
        )


class OwnSession:
    """Rejects what names the session of another simulator; what names none may be for any."""

    def __init__(self, session: str, log: Callable[[str], None]) -> None:
        """`log` is given one line for each of the first other sessions."""
        self.session = session
        self._log = log
        self._foreign = ForeignSessions()

    @property
    def counts(self) -> Counter[str]:
        """How many messages were rejected, by the topic's name."""
        return self._foreign.counts

    def rejects(self, topic: str, frame_id: str) -> bool:
        """Whether a message with this `frame_id` is for another simulator; it is counted then."""
        session = read_session(frame_id)
        if session in (self.session, ANONYMOUS):
            return False
        if line := self._foreign.reject(topic, session, self.session):
            self._log(line)
        return True
