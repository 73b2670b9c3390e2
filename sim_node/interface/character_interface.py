"""Interface of one character: subscribes to commands and wrenches, publishes its state."""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.stamped_subscription import StampedSubscription, first_tick
from msgs_config.errors import CommandError, LayoutError, MessageError
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.pins import decode_pins
from msgs_config.messages.session import OwnSession
from msgs_config.messages.wrenches import decode_wrenches
from sim_node.interface.publishers import CharacterPublishers
from sim_node.node_settings import NodeSettings
from sim_node.physics.pins import Pin, PinQueue
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.physics.wrenches import ExternalWrench, WrenchQueue
from sim_node.timing.lockstep import CommandStatus, LockstepBarrier
from sim_node.timing.zero_order_hold import ZeroOrderHold

_MS = 1e-6  # milliseconds in a nanosecond


class CharacterInterface:
    """Takes what is sent to one character, and keeps it for the tick that it is for."""

    def __init__(
        self,
        node: BusNode,
        character: SimulatedCharacter,
        clock: TickClock,
        settings: NodeSettings,
        own_session: OwnSession,
        logger: OnceLogger,
    ) -> None:
        """Offer the character's topics, below its name."""
        self.name = character.setup.name
        self.character = character
        self.settings = settings
        self.states = topics.JOINT_STATES.under(self.name)
        self.torques = topics.JOINT_TORQUES.under(self.name)
        self._clock = clock
        self._of = f" for '{self.name}'" if self.name else ""
        self._own_session = own_session
        self._once_logger = logger
        self.publishers = CharacterPublishers(node, character, settings, own_session.session)
        self.commands: LockstepBarrier | ZeroOrderHold
        names, commanded = character.layout.dof_names, character.commanded
        leaders = character.character.leaders
        if settings.is_realtime:
            self.commands = ZeroOrderHold(names, commanded, settings.command_timeout_ns, leaders)
        else:
            self.commands = LockstepBarrier(names, commanded, leaders)
        self.last_effort = self.commands.effort
        self._decoder = JointStateDecoder()
        self._torque_messages = node.subscription(self.torques)
        self._pushes = WrenchQueue(character.character)
        self._wrench = topics.EXTERNAL_WRENCH.under(self.name)
        self._wrench_messages = StampedSubscription(
            node, self._wrench, f"push{self._of} refused: ", self._add_pushes, logger, own_session
        )
        self._pins = PinQueue(character.character)
        self._pin = topics.PIN.under(self.name)
        self._pin_messages = StampedSubscription(
            node, self._pin, f"pin{self._of} refused: ", self._add_pins, logger, own_session
        )

    @property
    def missing(self) -> list[str]:
        """The degrees of freedom whose commands the tick waits for."""
        return [self.character.setup.prefix + name for name in self.commands.missing]

    @property
    def conflict(self) -> str:
        """The degree of freedom of the last conflict of commands."""
        return f"{self.character.setup.prefix}{self.commands.conflict}"

    def change(self, settings: NodeSettings) -> None:
        """Take changed settings, between two ticks."""
        self.settings = settings
        if isinstance(self.commands, ZeroOrderHold):
            self.commands.timeout_ns = settings.command_timeout_ns

    def begin_tick(self) -> None:
        """Begin to collect the commands that answer the present state."""
        self.commands.begin_tick(self.character.state.stamp_ns)

    def begin_episode(self) -> None:
        """Discard what was sent in the episode before, taken already or not."""
        self.commands.clear()
        self.last_effort = self.commands.effort
        self._pushes.clear()
        self._pins.clear()
        self._wrench_messages.discard()
        self._pin_messages.discard()
        self._torque_messages.discard()

    def take_command(self) -> CommandStatus | None:
        """Take a command if one is there, and return its status."""
        raw = self._torque_messages.take()
        if raw is None:
            return None
        try:
            command = self._decoder.decode(raw)
            if self._own_session.rejects(self.torques.name, command.frame_id):
                return CommandStatus.REJECTED
            indices = self.character.layout.indices(command.names)
            status = self.commands.submit(command.stamp_ns, indices, command.effort)
        except (MessageError, LayoutError, CommandError) as error:
            self.commands.counts[CommandStatus.REJECTED] += 1
            self._once_logger.log_once(f"command{self._of} rejected: {error}")
            return CommandStatus.REJECTED
        is_unstamped = status is CommandStatus.STALE and command.stamp_ns == 0
        if status is CommandStatus.FUTURE or is_unstamped:
            self._once_logger.log_once(
                f"command{self._of} dropped: it answers {command.stamp_ns} ns, the state is of "
                f"{self.commands.stamp_ns} ns; the stamp must be that of the state",
                kind=f"a {status.value} command{self._of}",
            )
        return status

    def fill_missing(self, *, holds: bool) -> None:
        """Command what is missing in lockstep: the last effort, or zero."""
        assert isinstance(self.commands, LockstepBarrier)  # real time has no missing commands
        last = self.last_effort
        self.commands.fill_missing(last if holds else np.zeros_like(last))

    def take_effort(self) -> FloatArray:
        """The commanded effort (n,) of the tick that ends now."""
        self.last_effort = self.commands.effort
        return self.last_effort

    def take_pushes(self) -> list[ExternalWrench]:
        """The pushes that act during the step that begins now, with those just sent."""
        self._wrench_messages.take()
        return self._pushes.take(self._clock.tick(self.character.state.stamp_ns))

    def take_pins(self) -> list[Pin]:
        """The changes of pins from the step on that begins now, with those just sent."""
        self._pin_messages.take()
        return self._pins.take(self._clock.tick(self.character.state.stamp_ns))

    def report(self) -> dict[str, object]:
        """Diagnostics: counts of commands, pushes, pins, saturations, and the commands' age."""
        counts, foreign = self.commands.counts, self._own_session.counts
        saturated = self.character.saturated_ticks
        values: dict[str, object] = {status.value: counts[status] for status in CommandStatus}
        values |= {
            "accepted_pushes": self._wrench_messages.accepted,
            "rejected_pushes": self._wrench_messages.rejected,
            "accepted_pins": self._pin_messages.accepted,
            "rejected_pins": self._pin_messages.rejected,
            "foreign_commands": foreign[self.torques.name],
            "foreign_pushes": foreign[self._wrench.name],
            "foreign_pins": foreign[self._pin.name],
            "saturated_ticks": sum(int(ticks) for ticks in saturated),
        }
        names = self.character.character.vector_names
        if named := [name for name, ticks in zip(names, saturated, strict=True) if ticks]:
            values["saturated"] = " ".join(named)
        if isinstance(self.commands, ZeroOrderHold):
            age_ns = self.commands.age_ns
            values["command_timeouts"] = self.commands.timeouts
            values["command_age_ms"] = "none" if age_ns is None else round(_MS * age_ns, 3)
        return values

    def _add_pins(self, raw: bytes) -> None:
        pins = decode_pins(raw)
        state_ns = self.character.state.stamp_ns
        self._pins.add(
            pins.links,
            pins.places,
            pins.points,
            pins.forces,
            first_tick=first_tick(self._clock, pins.stamp_ns, state_ns),
        )

    def _add_pushes(self, raw: bytes) -> None:
        wrenches = decode_wrenches(raw)
        state_ns = self.character.state.stamp_ns
        self._pushes.add(
            wrenches.links,
            wrenches.wrenches,
            wrenches.points,
            first_tick=first_tick(self._clock, wrenches.stamp_ns, state_ns),
            ticks=self.settings.push_ticks,
        )
