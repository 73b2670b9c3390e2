"""One character's place at the topics: commands and pushes in, its states out."""

from collections import Counter

from rclpy.node import Node

from msgs_config import configuration, topics
from msgs_config.errors import CommandError, LayoutError, MessageError
from msgs_config.messages import JointStateDecoder
from msgs_config.parameters import Values
from msgs_config.polling import DirectSubscription
from msgs_config.tick_clock import TickClock
from msgs_config.warnings import Warnings
from msgs_config.wrench_messages import WrenchArrays, decode_wrenches
from sim_node.actor import Actor
from sim_node.lockstep import LockstepBarrier, Verdict
from sim_node.outputs import Outputs
from sim_node.parameters import Cast, Part, command_timeout_ns, display_ticks, is_realtime
from sim_node.probe import measure_probe
from sim_node.pushes import Push, PushSchedule
from sim_node.realtime import CommandHold
from sim_node.simulation import Simulation
from sim_node.world import WorldSettings

Collector = LockstepBarrier | CommandHold

_MOST_PUSHES_A_TICK = 100  # messages, lest a flood of them stop the world
_PAST_PUSH = "a push of the past"
_MOST_FORGOTTEN = 20_000  # messages, more than can wait


class _PastPushError(CommandError):
    """A push is for a tick that is over, which is told once, whatever its stamp."""


class Port:
    """Takes what is sent to one character, and keeps it for the tick that it is for."""

    def __init__(self, node: Node, actor: Actor, collector: Collector, outputs: Outputs) -> None:
        """Subscribe to the character's topics; `collector` judges its commands."""
        namespace = actor.role.name
        self.actor = actor
        self.collector = collector
        self.outputs = outputs
        self.torques = topics.JOINT_TORQUES.under(namespace)
        self.last_effort = collector.effort
        self.push_counts = Counter[str]()
        self._pushes = PushSchedule(actor.character)
        self._decoder = JointStateDecoder()
        self._commands = DirectSubscription(node, self.torques)
        self._wrenches = DirectSubscription(node, topics.EXTERNAL_WRENCH.under(namespace))
        self.warnings = Warnings(node)
        self._of = f" for '{namespace}'" if namespace else ""

    @property
    def missing(self) -> list[str]:
        """The degrees of freedom whose commands the tick waits for."""
        return [self.actor.role.prefix + name for name in self.collector.missing]

    def open(self) -> None:
        """Begin to collect the commands that answer the present state."""
        self.collector.open(self.actor.state.stamp_ns)

    def forget(self) -> None:
        """Forget what was sent in the episode before, taken already or not."""
        self.collector.clear()
        self.last_effort = self.collector.effort
        self._pushes.clear()
        for unread in (self._commands, self._wrenches):
            for _ in range(_MOST_FORGOTTEN):
                if unread.take() is None:
                    break

    def take_command(self) -> Verdict | None:
        """Take a command if one is there; what was made of it."""
        raw = self._commands.take()
        if raw is None:
            return None
        try:
            command = self._decoder.decode(raw)
            indices = self.actor.layout.indices(command.names)
            verdict = self.collector.offer(command.stamp_ns, indices, command.effort)
        except (MessageError, LayoutError, CommandError) as error:
            self.collector.count_rejected()
            self.warnings.say_once(f"command{self._of} rejected: {error}")
            return Verdict.REJECTED
        if verdict is Verdict.FUTURE or (command.stamp_ns == 0 and verdict is Verdict.STALE):
            self.warnings.say_once(
                f"command{self._of} dropped: it answers {command.stamp_ns} ns, the state is of "
                f"{self.collector.stamp_ns} ns; the stamp must be that of the state",
                kind=f"a {verdict.value} command",
            )
        return verdict

    def take_pushes(self, clock: TickClock, tick: int, duration_ticks: int) -> list[Push]:
        """The pushes that act during the step that begins at a tick, with those just sent."""
        for _ in range(_MOST_PUSHES_A_TICK):
            raw = self._wrenches.take()
            if raw is None:
                break
            try:
                self._schedule(decode_wrenches(raw), clock, tick, duration_ticks)
                self.push_counts["accepted"] += 1
            except (MessageError, CommandError) as error:
                self.push_counts["rejected"] += 1
                kind = _PAST_PUSH if isinstance(error, _PastPushError) else ""
                self.warnings.say_once(f"push{self._of} refused: {error}", kind)
        return self._pushes.take(tick)

    def _schedule(
        self, wrenches: WrenchArrays, clock: TickClock, tick: int, duration_ticks: int
    ) -> None:
        first_tick = clock.first_tick_from(wrenches.stamp_ns) if wrenches.stamp_ns else tick
        if first_tick < tick:
            raise _PastPushError(
                f"its stamp, {wrenches.stamp_ns} ns, is over; the state is of "
                f"{clock.stamp_ns(tick)} ns; 0 means the next tick"
            )
        self._pushes.add(
            wrenches.links,
            wrenches.wrenches,
            wrenches.points,
            first_tick=first_tick,
            ticks=duration_ticks,
        )


def open_ports(node: Node, cast: Cast, simulation: Simulation) -> list[Port]:
    """A port for each character, its configuration published.

    Raises:
        CharacterError: the engine makes nothing sound of a character.
    """
    return [
        _open_port(node, part, actor, cast.values, simulation.settings.world)
        for part, actor in zip(cast.parts, simulation.actors, strict=True)
    ]


def _open_port(node: Node, part: Part, actor: Actor, values: Values, world: WorldSettings) -> Port:
    names, commanded = actor.layout.dof_names, actor.commanded
    collector: Collector = LockstepBarrier(names, commanded)
    if is_realtime(values):
        collector = CommandHold(names, commanded, command_timeout_ns(values))
    for note in actor.notes:
        node.get_logger().warning(f"{actor.role.prefix}{note}")
    outputs = Outputs(node, actor, display_ticks(values))
    probe = measure_probe(part.character, world.gravity)
    outputs.publish_configuration(
        configuration.describe(part.character, part.values, probe=probe, terrain=world.terrain)
    )
    return Port(node, actor, collector, outputs)
