"""Collects what a bag says of a world and none of its characters: balls that were thrown."""

from msgs_config.errors import CommandError, MessageError
from msgs_config.messages import topics
from msgs_config.messages.projectiles import BallStates, ThrowCodec, decode_balls
from msgs_config.messages.throw import ProjectileThrow

WORLD_TOPICS = tuple(topic.name for topic in (topics.THROW, topics.APPLIED_THROW, topics.THROWN))
"""Their names, below the simulator's namespace."""


class WorldTrack:
    """All that is said of the balls in one namespace."""

    def __init__(self) -> None:
        self.throws: dict[
            int, list[ProjectileThrow]
        ] = {}  # by the stamp of the state after the tick
        self.balls: dict[int, BallStates] = {}  # by stamp
        self.throws_sent = 0
        self._codec = ThrowCodec()

    def take(self, name: str, raw: bytes) -> None:
        """Take a message on one of `WORLD_TOPICS`.

        Raises:
            MessageError: it is not what the topic should carry.
        """
        if name == topics.THROW.name:
            self.throws_sent += 1
        elif name == topics.THROWN.name:
            balls = decode_balls(raw)
            self.balls[balls.stamp_ns] = balls
        else:
            try:
                stamp_ns, throw = self._codec.decode(raw)
            except CommandError as error:
                raise MessageError(f"'{name}' has a throw that cannot be: {error}") from error
            self.throws.setdefault(stamp_ns, []).append(throw)
