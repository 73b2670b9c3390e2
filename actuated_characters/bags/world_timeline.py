"""Collects the messages of a bag on one world: its balls, and the simulator's keyframes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from msgs_config.errors import CommandError, MessageError
from msgs_config.memory import is_own
from msgs_config.messages import topics
from msgs_config.messages.keyframe import decode_keyframe
from msgs_config.messages.projectiles import BallStates, ThrowCodec, decode_balls
from msgs_config.messages.throw import ProjectileThrow

_KEYFRAME = topics.KEYFRAME.of(topics.SIM_NODE).name


@dataclass
class Beginnings:
    """The states with which recordings of a bag may begin, beside the first ones of episodes."""

    first_ns: int = 0  # stamp before which none begins
    keyframes: set[int] = field(default_factory=set)  # their stamps so far


class WorldTimeline:
    """All messages on the balls in one namespace."""

    def __init__(self, namespace: str, begins: Beginnings) -> None:
        """`namespace` is without the leading slash; `begins` gets the keyframes' stamps."""
        self.namespace = namespace
        self.has_wall_times = True
        self.keyframes: dict[int, bytes] = {}  # serialised, by stamp
        self._begins = begins
        # by the stamp of the state after the tick in which they begin
        self.throws: dict[int, tuple[ProjectileThrow, ...]] = {}
        self.balls: dict[int, BallStates] = {}  # by stamp
        self.throws_sent = 0
        self._codec = ThrowCodec()

    def take(self, name: str, raw: bytes, published_ns: int) -> None:
        """Take a message on one of `TOPICS`.

        Raises:
            MessageError: it is no message of the topic's type and meaning.
        """
        self._TAKERS[name](self, raw)

    def _take_request(self, raw: bytes) -> None:
        self.throws_sent += 1

    def _take_keyframe(self, raw: bytes) -> None:
        keyframe = decode_keyframe(raw)
        if is_own(keyframe.memory):
            self.keyframes[keyframe.stamp_ns] = raw
            self._begins.keyframes.add(keyframe.stamp_ns)

    def _take_balls(self, raw: bytes) -> None:
        balls = decode_balls(raw)
        self.balls[balls.stamp_ns] = balls

    def _take_throw(self, raw: bytes) -> None:
        try:
            stamp_ns, throw = self._codec.decode(raw)
        except CommandError as error:
            name = topics.APPLIED_THROW.name
            raise MessageError(f"'{name}' has a throw that cannot be: {error}") from error
        self.throws[stamp_ns] = (*self.throws.get(stamp_ns, ()), throw)

    _TAKERS: ClassVar[dict[str, Callable[["WorldTimeline", bytes], None]]] = {
        topics.THROW.name: _take_request,
        topics.APPLIED_THROW.name: _take_throw,
        topics.THROWN.name: _take_balls,
        _KEYFRAME: _take_keyframe,
    }
    TOPICS: ClassVar = tuple(_TAKERS)
