"""`sim_node`: the simulation at one end of the topics, with whoever commands it at the other."""

import time
from collections.abc import Iterator

import numpy as np
from rclpy.node import Node

from msgs_config.errors import SimulationError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK
from msgs_config.messages.joint_state import encode_clock
from msgs_config.messages.session import given_session, make_session
from msgs_config.messages.topics import Outgoing
from msgs_config.parameters import Values
from msgs_config.runtime.diagnostics import DIAGNOSTICS_PERIOD, DiagnosticsPublisher
from msgs_config.runtime.once_logger import UNLOGGED, OnceLogger
from msgs_config.runtime.polling import PollingExecutor
from msgs_config.runtime.process import StopSignal
from msgs_config.runtime.ros_parameters import LiveParameters, declare, given_parameters
from sim_node.interface.character_interface import (
    CharacterInterface,
    open_ports,
    publish_configurations,
)
from sim_node.interface.initial_state_topic import InitialStates
from sim_node.interface.other_publishers import RivalWatch
from sim_node.interface.publisher_diagnosis import (
    UNKNOWN_NODE,
    describe_conflict,
    describe_waiting,
    publisher_names,
)
from sim_node.interface.services import Services
from sim_node.interface.status import report
from sim_node.interface.world_interface import WorldInterface
from sim_node.parameters import (
    command_timeout_ns,
    is_realtime,
    load_parameters,
    make_character_setup,
    make_settings,
    push_ticks,
    tick_period,
)
from sim_node.physics.simulation import Simulation
from sim_node.timing.flow_control import FlowControl
from sim_node.timing.lockstep import CommandStatus, LockstepBarrier
from sim_node.timing.rate_limiter import RateLimiter
from sim_node.timing.run_state import RunControl
from sim_node.timing.tick_times import TickTimes
from sim_node.timing.watchdog import Watchdog, WatchdogEvent
from sim_node.timing.zero_order_hold import ZeroOrderHold

_EXPLAIN_AFTER = 2.0  # s without a complete command before the node says what is missing
_FLUSH_TIME = 10.0  # s that subscribers may take to acknowledge the last messages
_STOP_FLUSH_TIME = 0.5  # s, after a signal or an error
_MOST_COMMANDS = 1000  # that are taken in a row in real time; a flood must not stop the world


class SimNode(Node):
    """Publishes the states of each tick; goes on when they are answered, or when it is time."""

    def __init__(self) -> None:
        """Read the parameters, build the world, and offer the topics.

        Raises:
            ActuatedCharactersError: a parameter or a character cannot be used.
        """
        super().__init__(topics.SIM_NODE)
        cast = load_parameters(given_parameters(self))
        values = self._values = cast.values
        self._realtime = is_realtime(values)
        roles = [
            make_character_setup(part.character, part.values, part.name) for part in cast.parts
        ]
        self._simulation = Simulation(roles, make_settings(values))
        self._initial_states = InitialStates(self, cast, self._simulation)
        declare(self, self._initial_states.known, values)
        self._session = given_session(values) or make_session(self.get_fully_qualified_name())
        self._once_logger = OnceLogger(self)
        self._ports = open_ports(self, cast, self._simulation, self._session, self._once_logger)
        self._rivals = RivalWatch(self, self._ports, self._session, self._once_logger)
        self._world_port = WorldInterface(self, self._simulation, self._session, self._once_logger)
        self._clock_topic = topics.create_publisher(self, topics.CLOCK)
        self._max_ticks = values.integer("max_ticks")
        self._patience = Watchdog(
            republish_period=values.number("republish_period"),
            explain_after=_EXPLAIN_AFTER,
            timeout=values.number("lockstep_timeout"),
        )
        self._pace = RateLimiter(tick_period(values))
        self._back_pressure = FlowControl(self._is_acknowledged)
        self._diagnostics = DiagnosticsPublisher(self)
        self._next_diagnostics = 0.0
        self._timeouts = 0
        self._conflicts: dict[
            str, CharacterInterface
        ] = {}  # joints of which commands compete in real time
        self._tick_times = TickTimes()
        self._begun = False
        self._control = RunControl()
        self._run_services = Services(self, self._control, self._resume, self._reset)
        LiveParameters(self, cast.declared, values, self._take_parameters)

    def run(self, stop: StopSignal) -> None:
        """Simulate until `max_ticks`, or until `stop`.

        Raises:
            SimulationError: a fault or a timeout whose parameter says `abort`, or no controller
                said where a reference begins.
            CharacterError: the engine makes nothing sound of a character.
        """
        spinner = PollingExecutor(self)
        try:
            cast = self._initial_states.settle(stop, spinner)
            if cast is None:
                return
            publish_configurations(
                self._ports, cast, self._simulation.settings.world, self._session
            )
            self._wait_for_subscribers(stop, spinner)
            self._begin_episode()
            while not stop and not self._finished:
                self._turn(spinner)
        finally:
            self._run_services.end(spinner)
            self._flush(_FLUSH_TIME if self._finished else _STOP_FLUSH_TIME)
            spinner.close()
            self._simulation.close()

    @property
    def _finished(self) -> bool:
        ticks = self._simulation.tick - FIRST_TICK
        return not self._control.has_diverged and 0 < self._max_ticks <= ticks

    @property
    def _complete(self) -> bool:
        return all(port.collector.complete for port in self._ports)

    def _wait_for_subscribers(self, stop: StopSignal, spinner: PollingExecutor) -> None:
        wanted = self._values.integer("wait_for_subscribers")
        self._patience.restart(time.monotonic())
        while not stop and (found := self._fewest_subscribers) < wanted:
            spinner.rest()
            if WatchdogEvent.EXPLAIN in self._patience.due(time.monotonic()):
                sentence = f"waiting for {wanted} subscribers of joint_states; there are {found}"
                self.get_logger().warning(f"{sentence}; has one not started, or ended?")

    @property
    def _fewest_subscribers(self) -> int:
        return min(port.outputs.state_subscribers for port in self._ports)

    def _turn(self, spinner: PollingExecutor) -> None:
        """Take commands, and advance if the tick is complete and due; or rest."""
        received = self._receive()
        if received:
            spinner.received()
            spinner.serve()  # a flood of commands must not keep services waiting
        if not (self._control.runs and self._complete):
            if not received:
                spinner.rest()
        elif wait := self._pace.wait(time.monotonic()):
            spinner.rest_for(wait)
        elif self._is_held_back():
            spinner.serve()
        else:
            self._advance()  # before the clock: a command that came in time is no timeout
        self._look_at_the_clock()

    def _is_held_back(self) -> bool:
        """Whether a subscriber is so far behind that it would lose messages; never in real time."""
        if self._realtime:
            return False
        if self._back_pressure.holds(self._simulation.tick, time.monotonic()):
            return True
        if self._back_pressure.complaint is not None:
            self._once_logger.log_once(self._back_pressure.complaint)
        return False

    def _is_acknowledged(self, seconds: float) -> bool:
        flushes = [port.outputs.flush for port in self._ports] + [self._world_port.flush]
        return all(flush(seconds) for flush in flushes)

    def _receive(self) -> bool:
        """Take one command a character, or all in real time; whether there was one."""
        received = False
        for port in self._ports:
            for _ in range(_MOST_COMMANDS if self._realtime else 1):
                verdict = port.take_command()
                if verdict is None:
                    break
                received = True
                if verdict is CommandStatus.CONFLICT:
                    self._on_conflict(port)
        return received

    def _flush(self, seconds: float) -> None:
        """Publish the last report, and wait until every subscriber has all that was published."""
        self._publish_diagnostics()
        deadline = time.monotonic() + seconds
        flushes = [port.outputs.flush for port in self._ports]
        flushes += [self._world_port.flush, self._diagnostics.flush]
        flushed = [flush(max(deadline - time.monotonic(), 0.0)) for flush in flushes]
        if not all(flushed):
            self.get_logger().warning("a subscriber has not acknowledged the last messages")

    def _begin_episode(self) -> None:
        for port in self._ports:
            port.outputs.publish_episode(self._simulation.episode, self._simulation.stamp_ns)
        self._begun = True
        self._pace.restart(time.monotonic())
        self._begin_tick()

    def _begin_tick(self) -> None:
        for port in self._ports:
            port.begin_tick()
        self._patience.restart(time.monotonic())
        topics.publish_together(self._messages())
        for port in self._ports:
            port.outputs.publish_display(self._simulation.tick)

    def _messages(self) -> Iterator[Outgoing]:
        """What is published of a tick before anybody can answer it, the states last."""
        yield self._clock_topic, encode_clock(self._simulation.stamp_ns)
        yield from self._world_port.messages()
        for port in self._ports:
            yield from port.outputs.before_state()
        for port in self._ports:
            yield port.outputs.state()

    def _advance(self) -> None:
        simulation = self._simulation
        self._pace.tick(time.monotonic())
        ticks = push_ticks(self._values)
        pushes = [
            port.take_pushes(simulation.clock, simulation.tick, ticks) for port in self._ports
        ]
        throws = self._world_port.take_throws()
        for port in self._ports:
            port.last_effort = port.collector.effort
        simulation.watches_contacts = any(port.outputs.wants_contacts for port in self._ports)
        try:
            simulation.step([port.last_effort for port in self._ports], pushes, throws)
        except SimulationError as error:
            self._raise_fault(str(error), stuck=True)
            return
        self._tick_times.tick()
        self._begin_tick()
        if self._control.tick():
            self._run_services.end_steps()

    def _on_conflict(self, port: CharacterInterface) -> None:
        if self._control.paused and not self._control.runs:
            return
        joint = f"{port.actor.role.prefix}{port.collector.conflict}"
        if self._realtime:
            self._conflicts[joint] = port  # finding out who publishes takes its time
        else:
            senders = publisher_names(self, port.torques)
            self._raise_fault(describe_conflict(joint, port.torques, senders))

    def _tell_conflicts(self) -> None:
        """Say who competes for a joint in real time, once for each, when their names are known."""
        for joint, port in self._conflicts.items():
            if not self._once_logger.has_logged(joint):
                senders = publisher_names(self, port.torques, wait_for_names=False)
                if UNKNOWN_NODE not in senders:
                    sentence = describe_conflict(joint, port.torques, senders)
                    self._once_logger.log_once(f"{sentence}; the last one counts", kind=joint)

    def _look_at_the_clock(self) -> None:
        now = time.monotonic()
        if now >= self._next_diagnostics:
            self._next_diagnostics = now + DIAGNOSTICS_PERIOD
            self._publish_diagnostics()
            self._tell_conflicts()
            self._rivals.look()
        for due in self._patience.due(now):
            waits = self._control.runs and not self._complete
            if due is WatchdogEvent.REPUBLISH:
                for port in self._ports:
                    port.outputs.republish(with_state=waits, with_episode=self._rivals.seen)
            elif waits and due is WatchdogEvent.EXPLAIN:
                self.get_logger().warning(self._describe_waiting())
            elif waits and self._simulation.tick > FIRST_TICK:  # before that it just waits
                self._on_timeout()

    def _describe_waiting(self) -> str:
        waiting = [port for port in self._ports if port.missing]
        return "; ".join(describe_waiting(self, port.torques, port.missing) for port in waiting)

    def _on_timeout(self) -> None:
        action = self._values.text("on_timeout")
        sentence = f"no command within {self._patience.timeout:g} s; {self._describe_waiting()}"
        if action == "abort":
            self._control.fault = sentence
            raise SimulationError(sentence)
        self.get_logger().warning(f"{sentence}; on_timeout: {action}")
        if action == "pause":
            self._pause(sentence)
            return
        self._timeouts += 1
        for port in self._ports:
            assert isinstance(port.collector, LockstepBarrier)  # real time has no missing commands
            held = port.last_effort
            port.collector.fill_missing(held if action == "hold" else np.zeros_like(held))

    def _raise_fault(self, sentence: str, *, stuck: bool = False) -> None:
        if self._values.text("on_fault") == "abort":
            self._control.pause(sentence, stuck=stuck)
            raise SimulationError(sentence)
        self.get_logger().error(f"{sentence}; paused")
        self._pause(sentence, stuck=stuck)

    def _pause(self, fault: str, *, stuck: bool = False) -> None:
        self._control.pause(fault, stuck=stuck)
        self._run_services.end_steps(fault)
        self._publish_diagnostics()

    def _resume(self) -> None:
        """Go on after a pause: what was collected before it is asked for again."""
        if self._begun:
            self._tick_times.resume()
            self._pace.restart(time.monotonic())
            self._begin_tick()

    def _reset(self) -> None:
        """Begin a new episode, now or when all who are waited for are there."""
        self._simulation.reset()
        self._world_port.forget()
        for port in self._ports:
            port.forget()
        self._tick_times.resume()
        if self._begun:
            self._begin_episode()

    def _take_parameters(self, values: Values) -> None:
        """Take changed parameters, at this tick's boundary."""
        self._values = values
        if (period := tick_period(values)) != self._pace.period:
            self._pace.change(period, time.monotonic())
        for port in self._ports:
            if isinstance(port.collector, ZeroOrderHold):
                port.collector.timeout_ns = command_timeout_ns(values)

    def _publish_diagnostics(self) -> None:
        if not self._diagnostics.is_heard:
            return
        values: dict[str, object] = {
            "tick": self._simulation.tick,
            "episode": self._simulation.episode,
            "session": self._session,
            "paused": self._control.paused,
            "timeouts": self._timeouts,
            UNLOGGED: self._once_logger.unlogged,
        }
        values |= self._tick_times.summary() | self._pace.summary() | self._world_port.counts
        for port in self._ports:
            self._diagnostics.publish(
                values | report(port), self._control.fault, below=port.actor.role.name
            )
