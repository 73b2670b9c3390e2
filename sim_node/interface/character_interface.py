"""One character's place at the topics: commands and pushes in, its states out."""

from collections import Counter
from collections.abc import Iterable

from rclpy.node import Node

from msgs_config.errors import CommandError, LayoutError, MessageError
from msgs_config.messages import configuration, topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.wrenches import decode_wrenches
from msgs_config.parameters import Values
from msgs_config.runtime.once_logger import OnceLogger
from msgs_config.runtime.polling import DirectSubscription
from sim_node.interface.inbox import FirstTick, OwnSession, StampedSubscription, forget
from sim_node.interface.publishers import Publishers
from sim_node.parameters import SimulatorParameters, command_timeout_ns, display_ticks, is_realtime
from sim_node.physics.probe import measure_probe
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.physics.simulation import Simulation
from sim_node.physics.world import WorldSettings
from sim_node.physics.wrenches import ExternalWrench, WrenchQueue
from sim_node.timing.lockstep import CommandStatus, LockstepBarrier
from sim_node.timing.zero_order_hold import ZeroOrderHold

Collector = LockstepBarrier | ZeroOrderHold


class CharacterInterface:
    """Takes what is sent to one character, and keeps it for the tick that it is for."""

    def __init__(
        self,
        node: Node,
        actor: SimulatedCharacter,
        collector: Collector,
        outputs: Publishers,
        session: str,
        logger: OnceLogger,
    ) -> None:
        """Subscribe to the character's topics; `collector` judges its commands."""
        namespace = actor.role.name
        self.actor = actor
        self.collector = collector
        self.outputs = outputs
        self.states = topics.JOINT_STATES.under(namespace)
        self.torques = topics.JOINT_TORQUES.under(namespace)
        self.last_effort = collector.effort
        self._pushes = WrenchQueue(actor.character)
        self._decoder = JointStateDecoder()
        self._commands = DirectSubscription(node, self.torques)
        self._once_logger = logger
        self._of = f" for '{namespace}'" if namespace else ""
        self._own = OwnSession(session, logger)
        self._wrench = topics.EXTERNAL_WRENCH.under(namespace)
        self._wrenches = StampedSubscription(
            node, self._wrench, "push", self._of, self._own, logger
        )

    @property
    def push_counts(self) -> Counter[str]:
        """How many pushes were taken and refused."""
        return self._wrenches.counts

    @property
    def foreign_counts(self) -> dict[str, object]:
        """How many commands and pushes named the session of another simulator."""
        counts = self._own.counts
        return {
            "foreign_commands": counts[self.torques.name],
            "foreign_pushes": counts[self._wrench.name],
        }

    @property
    def missing(self) -> list[str]:
        """The degrees of freedom whose commands the tick waits for."""
        return [self.actor.role.prefix + name for name in self.collector.missing]

    def begin_tick(self) -> None:
        """Begin to collect the commands that answer the present state."""
        self.collector.begin_tick(self.actor.state.stamp_ns)

    def forget(self) -> None:
        """Forget what was sent in the episode before, taken already or not."""
        self.collector.clear()
        self.last_effort = self.collector.effort
        self._pushes.clear()
        self._wrenches.forget()
        forget(self._commands)

    def take_command(self) -> CommandStatus | None:
        """Take a command if one is there; what was made of it."""
        raw = self._commands.take()
        if raw is None:
            return None
        try:
            command = self._decoder.decode(raw)
            if self._own.rejects(self.torques, command.frame_id):
                return CommandStatus.REJECTED
            indices = self.actor.layout.indices(command.names)
            verdict = self.collector.submit(command.stamp_ns, indices, command.effort)
        except (MessageError, LayoutError, CommandError) as error:
            self.collector.count_rejected()
            self._once_logger.log_once(f"command{self._of} rejected: {error}")
            return CommandStatus.REJECTED
        if verdict is CommandStatus.FUTURE or (
            command.stamp_ns == 0 and verdict is CommandStatus.STALE
        ):
            self._once_logger.log_once(
                f"command{self._of} dropped: it answers {command.stamp_ns} ns, the state is of "
                f"{self.collector.stamp_ns} ns; the stamp must be that of the state",
                kind=f"a {verdict.value} command{self._of}",
            )
        return verdict

    def take_pushes(self, clock: TickClock, tick: int, duration_ticks: int) -> list[ExternalWrench]:
        """The pushes that act during the step that begins at a tick, with those just sent."""

        def schedule(raw: bytes, first_tick: FirstTick) -> None:
            wrenches = decode_wrenches(raw)
            self._pushes.add(
                wrenches.links,
                wrenches.wrenches,
                wrenches.points,
                first_tick=first_tick(wrenches.stamp_ns),
                ticks=duration_ticks,
            )

        self._wrenches.take(clock, tick, schedule)
        return self._pushes.take(tick)


def open_ports(
    node: Node, cast: SimulatorParameters, simulation: Simulation, session: str, logger: OnceLogger
) -> list[CharacterInterface]:
    """A port for each character; all say the same session."""
    return [_open_port(node, actor, cast.values, session, logger) for actor in simulation.actors]


def publish_configurations(
    ports: Iterable[CharacterInterface],
    cast: SimulatorParameters,
    world: WorldSettings,
    session: str,
) -> None:
    """Publish what the run of each character depends on, its initial state among it.

    Raises:
        CharacterError: the engine makes nothing sound of a character.
    """
    for port, part in zip(ports, cast.parts, strict=True):
        port.outputs.publish_configuration(
            configuration.describe(
                part.character,
                part.values,
                probe=measure_probe(part.character, world.gravity),
                terrain=world.terrain,
                name=part.name,
                characters=cast.names,
                session=session,
            )
        )


def _open_port(
    node: Node, actor: SimulatedCharacter, values: Values, session: str, logger: OnceLogger
) -> CharacterInterface:
    names, commanded = actor.layout.dof_names, actor.commanded
    collector: Collector = LockstepBarrier(names, commanded)
    if is_realtime(values):
        collector = ZeroOrderHold(names, commanded, command_timeout_ns(values))
    for warning in actor.warnings:
        node.get_logger().warning(f"{actor.role.prefix}{warning}")
    outputs = Publishers(node, actor, display_ticks(values), session)
    return CharacterInterface(node, actor, collector, outputs, session, logger)
