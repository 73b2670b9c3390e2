"""What concerns a world and none of its characters: balls that are thrown into it."""

from collections.abc import Iterator

from rclpy.node import Node

from msgs_config.messages import topics
from msgs_config.messages.projectiles import BallStates, ThrowCodec, ball_names, encode_balls
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.topics import Outgoing
from msgs_config.runtime.once_logger import OnceLogger
from sim_node.interface.inbox import FirstTick, OwnSession, StampedSubscription
from sim_node.physics.simulation import Simulation
from sim_node.physics.throws import ThrowQueue


class WorldInterface:
    """Takes throws, and says which ones began and where the balls are."""

    def __init__(
        self, node: Node, simulation: Simulation, session: str, logger: OnceLogger
    ) -> None:
        """Offer the topics, in the node's own namespace."""
        self._session = session
        self._own = OwnSession(session, logger)
        self._simulation = simulation
        self._schedule = ThrowQueue()
        self._codec = ThrowCodec(session)
        self._told_ns = -1  # of the last throws that were published
        self._inbox = StampedSubscription(node, topics.THROW, "throw", "", self._own, logger)
        self._applied = topics.create_publisher(node, topics.APPLIED_THROW)
        self._thrown = topics.create_publisher(node, topics.THROWN)

    @property
    def counts(self) -> dict[str, object]:
        """How many throws were taken and refused, for the diagnostics."""
        counts = {f"{kind}_throws": self._inbox.counts[kind] for kind in ("accepted", "rejected")}
        return {**counts, "foreign_throws": self._own.counts[topics.THROW.name]}

    def take_throws(self) -> list[ProjectileThrow]:
        """The throws that begin with the present state, with those just sent."""
        simulation = self._simulation
        self._inbox.take(simulation.clock, simulation.tick, self._use)
        return self._schedule.take(simulation.tick)

    def forget(self) -> None:
        """Forget what was sent in the episode before, taken already or not."""
        self._schedule.clear()
        self._inbox.forget()

    def messages(self) -> Iterator[Outgoing]:
        """What was thrown in the tick before, and where the balls are, if there are any."""
        simulation = self._simulation
        if not simulation.balls:
            return
        if simulation.stamp_ns != self._told_ns:  # after a pause a tick begins again
            self._told_ns = simulation.stamp_ns
            for throw in simulation.throws:
                yield self._applied, self._codec.encode(simulation.stamp_ns, throw)
        if self._thrown.get_subscription_count():
            names = ball_names(len(simulation.balls))
            balls = BallStates(simulation.stamp_ns, names, simulation.ball_motion())
            yield self._thrown, encode_balls(balls, self._session)

    def flush(self, seconds: float) -> bool:
        """Wait until every subscriber has all that was said, at the most `seconds`; whether so."""
        return topics.flush((self._applied, self._thrown), seconds)

    def _use(self, raw: bytes, first_tick: FirstTick) -> None:
        stamp_ns, throw = self._codec.decode(raw)
        self._schedule.add(throw, first_tick(stamp_ns))
