"""Interface of the world: takes throws, and publishes the balls."""

from collections.abc import Iterator

from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.publishing import Outgoing, has_subscribers
from msgs_config.bus.stamped_subscription import StampedSubscription, first_tick
from msgs_config.messages import topics
from msgs_config.messages.projectiles import BallStates, ThrowCodec, ball_names, encode_balls
from msgs_config.messages.session import OwnSession
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.balls.throws import ThrowQueue
from sim_node.physics.simulation import Simulation


class WorldInterface:
    """Takes throws, and publishes which ones began and where the balls are."""

    def __init__(
        self, node: BusNode, simulation: Simulation, own_session: OwnSession, logger: OnceLogger
    ) -> None:
        """Offer the topics, in the node's own namespace."""
        self._own_session = own_session
        self._simulation = simulation
        self._queue = ThrowQueue()
        self._codec = ThrowCodec(own_session.session)
        self._published_ns = -1  # stamp of the last throws that were published
        self._messages = StampedSubscription(
            node, topics.THROW, "throw refused: ", self._add_throw, logger, own_session
        )
        self._applied = node.publisher(topics.APPLIED_THROW)
        self._thrown = node.publisher(topics.THROWN)
        self._throttled = node.publisher(topics.THROWN_THROTTLE)
        self.publishers = (self._applied, self._thrown, self._throttled)

    def take_throws(self) -> list[ProjectileThrow]:
        """The throws that begin with the present state, with those just sent."""
        self._messages.take()
        return self._queue.take(self._simulation.tick)

    def throw(self, throw: ProjectileThrow) -> None:
        """Let a ball or box go with the next tick. Raises CommandError if there are too many."""
        self._queue.add(throw, self._simulation.tick)

    def begin_episode(self) -> None:
        """Discard what was sent in the episode before, taken already or not."""
        self._queue.clear()
        self._messages.discard()

    def messages(self) -> Iterator[Outgoing]:
        """The throws of the tick before, and where the balls are, if there are any."""
        simulation = self._simulation
        if not simulation.balls:
            return
        # A tick that begins again after a pause has published its throws already.
        if simulation.stamp_ns != self._published_ns:
            self._published_ns = simulation.stamp_ns
            for throw in simulation.throws:
                yield self._applied, self._codec.encode(simulation.stamp_ns, throw)
        if has_subscribers(self._thrown):
            yield self._thrown, self._encode_balls()

    def throttled(self) -> Iterator[Outgoing]:
        """Where the balls are, if there are any, for those who do not need each tick's."""
        if self._simulation.balls and has_subscribers(self._throttled):
            yield self._throttled, self._encode_balls()

    def report(self) -> dict[str, object]:
        """Diagnostics: counts of throws."""
        return {
            "accepted_throws": self._messages.accepted,
            "rejected_throws": self._messages.rejected,
            "foreign_throws": self._own_session.counts[topics.THROW.name],
        }

    def _encode_balls(self) -> bytes:
        simulation = self._simulation
        names = ball_names(simulation.balls)
        balls = BallStates(simulation.stamp_ns, names, simulation.ball_motion())
        return encode_balls(balls, self._own_session.session)

    def _add_throw(self, raw: bytes) -> None:
        stamp_ns, throw = self._codec.decode(raw)
        clock, state_ns = self._simulation.clock, self._simulation.stamp_ns
        self._queue.add(throw, first_tick(clock, stamp_ns, state_ns))
