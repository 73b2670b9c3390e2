"""The simulator that the controller is bound to, among all that publish."""

from collections.abc import Callable
from dataclasses import dataclass

from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.errors import ActuatedCharactersError, ClockError, MessageError
from msgs_config.messages import configuration, topics
from msgs_config.messages.cdr import decode_header, decode_string, read_frame_id
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.session import (
    ForeignSessions,
    SessionBinding,
    episode_session,
    named,
    read_session,
)

_CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE)
_MOST_KNOWN = 8  # simulators of which something is kept
_MOST_AT_ONCE = 1000  # foreign states in a row
_EXPLAIN_AFTER = 2.0  # s without a message that says when the episode began
_ALONE_AFTER = 1.0  # s in which another simulator would have been discovered


@dataclass
class _KnownSimulator:
    """The configuration and episode that one simulator published."""

    configuration: RunConfiguration | None = None
    error: ActuatedCharactersError | None = None  # says why this controller does not fit it
    episode_ns: int | None = None


class Simulators:
    """Takes `~/configuration` and `episode` of all simulators, and binds to one of them.

    It binds to the session that is given, or else to the first whose state can be used. Messages of
    the others are rejected, counted, and logged once for each.
    """

    def __init__(
        self,
        node: BusNode,
        session: str,
        clock: TickClock,
        check: Callable[[RunConfiguration], None],
        logger: OnceLogger,
    ) -> None:
        """`check` raises an error if a simulator is not what this controller was made for."""
        self._count_publishers = lambda: node.count_publishers(topics.JOINT_STATES.name)
        self._binding = SessionBinding(session, self._count_publishers)
        self._foreign = ForeignSessions()
        self._clock = clock
        self._check = check
        self._once_logger = logger
        self._known: dict[str, _KnownSimulator] = {}  # by session, the oldest first
        self._rejected_episodes = 0
        self._now = 0.0
        self._lacks_episode_since: float | None = None
        self._disagrees_since: float | None = None
        depth = 2 * _MOST_KNOWN  # messages of one simulator must not push out another's
        self._episodes = node.subscription(topics.EPISODE.for_listener(depth))
        self._configurations = node.subscription(_CONFIGURATION.for_listener(depth))
        self.runs_on = False
        """Whether the simulator runs in real time, and waits for no answer."""

    @property
    def bound(self) -> str | None:
        """The session of the simulator that this controller belongs to; None if not known yet."""
        return self._binding.bound

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of rejected messages, for the diagnostics."""
        counts = self._foreign.counts
        return {
            "foreign_states": counts[topics.JOINT_STATES.name],
            "foreign_contacts": counts[topics.CONTACTS.name],
            "foreign_configurations": counts[_CONFIGURATION.name],
            "rejected_episodes": counts[topics.EPISODE.name] + self._rejected_episodes,
        }

    def take_messages(self, now: float) -> None:
        """Take episodes and configurations of simulators; `now` in s of wall time.

        Raises:
            ActuatedCharactersError: the one of the session that is given simulates something else
                than this controller was made for. Without one it waits for a simulator that fits.
        """
        self._now = now
        self._binding.note_look(now)
        self._take_episode()
        self._take_configuration()

    def next_state(self, take: Callable[[], bytes | None]) -> bytes | None:
        """The next state that is not foreign, serialised; None if there is none now."""
        for _ in range(_MOST_AT_ONCE):
            raw = take()
            if raw is None or self._admits(raw):
                return raw
        return None

    def bind(self, frame_id: str) -> bool:
        """Take a usable state with this `frame_id`; whether that binds to a new simulator."""
        session = read_session(frame_id)
        is_new = self._binding.take(session)
        if is_new:
            self._lacks_episode_since, self.runs_on = None, False
            self._judge(self._known_of(session))
        return is_new

    def is_own(self, topic: str, frame_id: str) -> bool:
        """Whether a message is of the bound simulator; else it is counted as foreign."""
        session = read_session(frame_id)
        if self._binding.hear(session):
            return True
        self._reject(topic, session)
        return False

    def episode_before(self, stamp_ns: int) -> int | None:
        """Stamp of the first state of the episode that goes on at a stamp, from `episode`.

        None if it is not known yet; after a while that is logged.
        """
        session, known = self._binding.bound, self._bound_one
        if known is not None and known.episode_ns is not None and known.episode_ns <= stamp_ns:
            self._lacks_episode_since = None
            return known.episode_ns
        if self._lacks_episode_since is None:
            self._lacks_episode_since = self._now
        elif self._now > self._lacks_episode_since + _EXPLAIN_AFTER:
            self._once_logger.log_once(
                f"waiting for a message on '{topics.EPISODE.name}' that says when the episode of "
                f"the state of {stamp_ns} ns began; its session must be {named(session)}"
            )
        return None

    @property
    def configuration(self) -> RunConfiguration | None:
        """What the bound simulator has published of itself last; None if nothing."""
        known = self._bound_one
        return None if known is None else known.configuration

    def disagrees(self) -> bool:
        """Whether the bound simulator is not, or not any more, what the controller is made for.

        After a while, in which its configuration may be on its way, that is logged.
        """
        known = self._bound_one
        if known is None or known.error is None:
            self._disagrees_since = None
            return False
        self._disagrees_since = self._disagrees_since or self._now
        if self._now > self._disagrees_since + _ALONE_AFTER:
            self._once_logger.log_once(
                f"no state is answered: {known.error}; set the parameter on either side to the "
                "other's, and reset"
            )
        return True

    def check_again(self) -> None:
        """Compare another controller with all simulators."""
        for known in self._known.values():
            if known.configuration is not None:
                known.error = self._error_of(known.configuration)

    @property
    def _bound_one(self) -> _KnownSimulator | None:
        session = self._binding.bound
        return None if session is None else self._known.get(session)

    def _admits(self, raw: bytes) -> bool:
        try:
            session = read_session(read_frame_id(raw))
        except MessageError:
            return True  # the decoder says what is wrong with it
        if not self._binding.admits(session):
            self._reject(topics.JOINT_STATES.name, session)
            return False
        known = self._known.get(session)
        if self._binding.bound is None and known is not None and known.error is not None:
            self._pass_over(known.error)
            return False
        return True

    def _reject(self, topic: str, session: str) -> None:
        line = self._foreign.reject(topic, session, self._binding.bound)
        if line is not None:
            self._once_logger.log_once(line)

    def _take_episode(self) -> None:
        raw = self._episodes.take()
        if raw is None:
            return
        try:
            stamp_ns, frame_id = decode_header(raw)
            session = episode_session(frame_id)
            if self._binding.bound is not None and not self._binding.hear(session):
                self._reject(topics.EPISODE.name, session)
                return
            if self._clock.tick(stamp_ns) < FIRST_TICK:
                raise ClockError(f"its stamp, {stamp_ns} ns, is before the first tick")
        except (MessageError, ClockError) as error:
            self._rejected_episodes += 1
            self._once_logger.log_once(f"episode ignored: {error}")
            return
        self._known_of(session).episode_ns = stamp_ns

    def _take_configuration(self) -> None:
        raw = self._configurations.take()
        if raw is not None:
            try:
                self._hear_configuration(configuration.parse(decode_string(raw)))
            except MessageError as error:
                self._once_logger.log_once(f"configuration ignored: {error}")

    def _hear_configuration(self, found: RunConfiguration) -> None:
        if self._binding.bound not in (None, found.session):
            self._reject(_CONFIGURATION.name, found.session)
        known = self._known_of(found.session)
        is_first = known.configuration is None
        known.configuration, known.error = found, self._error_of(found)
        if self._binding.bound is None and known.error is not None:
            self._pass_over(known.error)
        if self._binding.bound != found.session:
            return
        if not is_first:
            return  # a reset has changed the configuration; `disagrees` says so
        if known.error is not None and self._binding.release():
            self._pass_over(known.error)  # the first state came before the configuration
            return
        self._judge(known)

    def _judge(self, known: _KnownSimulator) -> None:
        """Raise the error if the bound simulator is not what this controller was made for."""
        if known.configuration is not None:
            self.runs_on = known.configuration.parameters.get("mode") == "realtime"
        if known.error is not None:
            raise known.error

    def _pass_over(self, error: ActuatedCharactersError) -> None:
        """Say why a simulator is not the one that this controller was made for."""
        self._once_logger.log_once(f"state ignored: {error}; waiting for a simulator that fits")

    def _error_of(self, found: RunConfiguration) -> ActuatedCharactersError | None:
        """Why a simulator is not the one that this controller was made for."""
        try:
            self._check(found)
        except ActuatedCharactersError as error:
            return error
        return None

    def _known_of(self, session: str) -> _KnownSimulator:
        if session not in self._known:
            if len(self._known) == _MOST_KNOWN:
                others = (name for name in self._known if name != self._binding.bound)
                del self._known[next(others)]
            self._known[session] = _KnownSimulator()
        return self._known[session]
