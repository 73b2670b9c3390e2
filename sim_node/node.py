"""`sim_node`: the simulation behind its topics, in lockstep with controllers or real time."""

import time
from collections.abc import Mapping

from msgs_config.bus.composition import AT_ONCE, UNTIL_A_MESSAGE, ComposableNode, Turns, ros_node
from msgs_config.bus.diagnostics import DIAGNOSTICS_PERIOD, DiagnosticsPublisher
from msgs_config.bus.node import BusNode, Executor, StopFlag
from msgs_config.bus.once_logger import UNLOGGED, OnceLogger
from msgs_config.errors import SimulationError
from msgs_config.messages import topics
from msgs_config.messages.session import OwnSession, make_session
from msgs_config.parameters import Values
from sim_node.interface.character_interface import CharacterInterface
from sim_node.interface.episode_parameters import EpisodeParameters
from sim_node.interface.initial_state_topic import InitialStates, log_warnings
from sim_node.interface.keyframes import SimulatorKeyframes
from sim_node.interface.publisher_diagnosis import (
    ConflictLog,
    OtherSimulators,
    describe_conflict,
    describe_waiting,
)
from sim_node.interface.publishers import wait_for_subscribers
from sim_node.interface.services import Services
from sim_node.interface.simulator_publisher import SimulatorPublisher
from sim_node.interface.standard.entities import Entities
from sim_node.interface.standard.requests import Operations, StandardServices, is_installed
from sim_node.interface.world_interface import WorldInterface
from sim_node.node_settings import NodeSettings
from sim_node.parameters import SimulatorParameters, load_parameters
from sim_node.physics.probe import measure_probe
from sim_node.physics.settings import WorldSettings
from sim_node.simulation_factory import make_simulation
from sim_node.timing.flow_control import FlowControl
from sim_node.timing.lockstep import CommandStatus
from sim_node.timing.rate_limiter import RateLimiter
from sim_node.timing.run_control import RunControl
from sim_node.timing.watchdog import Watchdog, WatchdogEvent

_FLUSH_TIME = 10.0  # s that subscribers may take to acknowledge the last messages
_STOP_FLUSH_TIME = 0.5  # s that subscribers may take after a signal or an error
_MOST_COMMANDS = 1000  # taken in a row in real time; a flood must not stop the world


class SimNode(ComposableNode):
    """Publishes the states of each tick; advances when they are answered, or when it is time."""

    def __init__(self, node: BusNode | None = None) -> None:
        """Read the parameters, build the world, and offer the topics.

        Without a place on a bus it is a node of ROS.

        Raises:
            ActuatedCharactersError: a parameter or a character cannot be used.
        """
        super().__init__(node or ros_node(topics.SIM_NODE))
        loaded = load_parameters(self.node.given_parameters())
        self._settings = NodeSettings.of(loaded.values)
        self._build_simulation(loaded)
        self._given = EpisodeParameters(self.node, loaded, self._change_parameters)
        self.session = self._settings.session.id or make_session(
            self.node.get_fully_qualified_name()
        )
        """The session of all messages of this simulator."""
        self._once_logger = OnceLogger(self.node.get_logger())
        self._keyframes = SimulatorKeyframes(
            self.node, self._simulation, loaded.values, self.session, self._once_logger
        )
        self._open_topics()
        self._watchdog = Watchdog(self._settings.republish_period, self._settings.lockstep_timeout)
        self._rate_limiter = RateLimiter(self._settings.tick_period)
        self._flow_control = FlowControl(
            self._publisher.is_acknowledged,
            self._once_logger.log_once,
            not self._settings.is_realtime,
        )
        self._next_diagnostics, self._timeouts, self._begun = 0.0, 0, False
        self._first_tick = self._simulation.tick
        self._control = RunControl()
        self._run_services = Services(
            self.node, self._control, lambda: self._settings.step_count, self._resume, self._reset
        )
        self._entities = Entities(self._simulation, self._world.throw)
        self._standard = StandardServices(
            Operations(
                self._run_services,
                self._control,
                self._simulation,
                self._entities,
                str(loaded.values["terrain"]),
                self._begin_with,
            )
        )
        if is_installed():
            self._standard.offer(self.node)

    @property
    def characters(self) -> list[str]:
        """The names of the characters; empty of one that is alone and below no name."""
        return [each.name for each in self._characters]

    def destroy_node(self) -> None:
        """Leave the bus, and end the engine."""
        super().destroy_node()
        self._simulation.close()

    def _build_simulation(self, loaded: SimulatorParameters) -> None:
        """Build the world, and probe the engine."""
        world = WorldSettings.of(loaded.values)
        self._samples = [
            measure_probe(each.character, world.gravity, world.engine) for each in loaded.characters
        ]
        self._simulation = make_simulation(loaded)
        self._initial_states = InitialStates(self.node, self._simulation.characters, loaded)

    def _open_topics(self) -> None:
        own_session = OwnSession(self.session, self._once_logger.log_once)
        self._characters = [
            CharacterInterface(
                self.node,
                character,
                self._simulation.clock,
                self._settings,
                own_session,
                self._once_logger,
            )
            for character in self._simulation.characters
        ]
        self._world = WorldInterface(self.node, self._simulation, own_session, self._once_logger)
        publishers = [each.publishers for each in self._characters]
        self._publisher = SimulatorPublisher(
            self.node, self._simulation, self._world, publishers, self._samples, self._keyframes
        )
        self._diagnostics = DiagnosticsPublisher(self.node)
        self._conflict_log = ConflictLog(self.node, self._once_logger)
        self._others = OtherSimulators(
            self.node, [each.states for each in self._characters], self.session, self._once_logger
        )

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Simulate until `max_ticks`, or until `stop`.

        Raises:
            SimulationError: a fault or a timeout whose parameter says `abort`, or no controller
                published where a reference begins.
            CharacterError: a mesh cannot be read.
        """
        try:
            yield from self._begin(stop)
            while not (stop or self._finished or self._control.quits):
                yield self._spin_once(executor)
        finally:
            self._run_services.end(executor)
            self._publish_diagnostics()
            seconds = _FLUSH_TIME if self._finished else _STOP_FLUSH_TIME
            if not (self._publisher.is_acknowledged(seconds) and self._diagnostics.flush(seconds)):
                self.node.get_logger().warning(
                    "a subscriber has not acknowledged the last messages"
                )
            self._simulation.close()

    @property
    def _finished(self) -> bool:
        ticks = self._simulation.tick - self._first_tick
        return not self._control.has_diverged and 0 < self._settings.max_ticks <= ticks

    @property
    def _complete(self) -> bool:
        return all(each.commands.complete for each in self._characters)

    def _begin(self, stop: StopFlag) -> Turns:
        """Begin the first episode when initial states and subscribers are there."""
        states = yield from self._initial_states.wait(stop)
        if stop:
            return
        if states:
            self._simulation.begin_in(states)
        self._given.begin_in(states)
        self._keyframes.go_on()
        self._first_tick = self._simulation.tick
        # A run, which gives its simulator the session, has shown the warnings itself.
        if not self._settings.session.id:
            log_warnings(self.node, self._given.in_force)
        self._publisher.publish_configurations(self._given.in_force)
        count = self._settings.wait_for_subscribers
        yield from wait_for_subscribers(self.node, self._publisher.of_characters, count, stop)
        self._begin_episode(self._keyframes.episode_ns)

    def _spin_once(self, executor: Executor) -> float:
        """Take commands, and advance if the tick is complete and due; the turn's result."""
        received, idle_seconds = self._receive(), AT_ONCE
        if received:
            executor.received()
            executor.serve()  # a flood of commands must not keep services waiting
        if not (self._control.runs and self._complete):
            if not received:
                idle_seconds = UNTIL_A_MESSAGE
        elif wait := self._rate_limiter.wait(time.monotonic()):
            idle_seconds = wait
        elif self._flow_control.holds(self._simulation.tick, time.monotonic()):
            executor.serve()
        else:
            self._advance()  # before the watchdog: a command that came in time is no timeout
        self._run_watchdog()
        return idle_seconds

    def _receive(self) -> bool:
        """Take one command a character, or all in real time; whether there was one."""
        received = False
        for each in self._characters:
            for _ in range(_MOST_COMMANDS if self._settings.is_realtime else 1):
                status = each.take_command()
                if status is None:
                    break
                received = True
                if status is CommandStatus.CONFLICT and self._control.runs:
                    self._on_conflict(each)
        return received

    def _begin_episode(self, first_ns: int) -> None:
        """Begin to simulate an episode, whose first state has that stamp: at it, or later."""
        self._publisher.publish_episode(first_ns)
        self._begun = True
        self._rate_limiter.restart(time.monotonic())
        self._begin_tick()

    def _begin_tick(self) -> None:
        for each in self._characters:
            each.begin_tick()
        self._watchdog.restart(time.monotonic())
        self._publisher.publish_tick()

    def _advance(self) -> None:
        simulation, characters = self._simulation, self._characters
        self._rate_limiter.tick(time.monotonic())
        pushes = [each.take_pushes() for each in characters]
        pins = [each.take_pins() for each in characters]
        throws = self._world.take_throws()
        efforts = [each.take_effort() for each in characters]
        simulation.watches_contacts = self._publisher.wants_contacts()
        try:
            simulation.step(efforts, pushes, throws, pins)
        except SimulationError as error:
            self._raise_fault(str(error), diverged=True)
            return
        self._begin_tick()
        if self._control.tick():
            self._run_services.end_steps()
        else:
            self._standard.after_tick()

    def _on_conflict(self, character: CharacterInterface) -> None:
        if self._settings.is_realtime:
            self._conflict_log.add(character.conflict, character.torques)
        else:
            self._raise_fault(describe_conflict(self.node, character.conflict, character.torques))

    def _run_watchdog(self) -> None:
        self._publisher.make_up()
        now = time.monotonic()
        if now >= self._next_diagnostics:
            self._next_diagnostics = now + DIAGNOSTICS_PERIOD
            self._publish_diagnostics()
            self._conflict_log.log()
            self._others.look_at_graph()
        for event in self._watchdog.due(now):
            waits = self._control.runs and not self._complete
            if event is WatchdogEvent.REPUBLISH:
                self._publisher.republish(with_states=waits, with_episode=self._others.seen)
            elif waits and event is WatchdogEvent.EXPLAIN:
                self.node.get_logger().warning(self._describe_waiting())
            elif waits and self._simulation.tick > self._first_tick:  # that one just waits
                self._on_timeout()

    def _describe_waiting(self) -> str:
        incomplete = [each for each in self._characters if each.missing]
        return "; ".join(
            describe_waiting(self.node, each.torques, each.missing) for each in incomplete
        )

    def _on_timeout(self) -> None:
        action = self._settings.on_timeout
        sentence = f"no command within {self._watchdog.timeout:g} s; {self._describe_waiting()}"
        if action == "abort":
            self._control.fault = sentence
            raise SimulationError(sentence)
        self.node.get_logger().warning(f"{sentence}; on_timeout: {action}")
        if action == "pause":
            self._pause(sentence)
            return
        self._timeouts += 1
        for each in self._characters:
            each.fill_missing(holds=action == "hold")

    def _raise_fault(self, sentence: str, *, diverged: bool = False) -> None:
        if self._settings.on_fault == "abort":
            self._control.pause(sentence, diverged=diverged)
            raise SimulationError(sentence)
        self.node.get_logger().error(f"{sentence}; paused")
        self._pause(sentence, diverged=diverged)

    def _pause(self, fault: str, *, diverged: bool = False) -> None:
        self._control.pause(fault, diverged=diverged)
        self._run_services.end_steps(fault)
        self._publish_diagnostics()

    def _resume(self) -> None:
        """Go on after a pause: what was collected before it is asked for again."""
        if self._begun:
            self._rate_limiter.restart(time.monotonic())
            self._begin_tick()

    def _reset(self) -> None:
        """Begin a new episode, now or when all awaited subscribers are there."""
        last_ns = self._simulation.stamp_ns
        starts = self._given.begin_episode(self._initial_states.newest())
        world = self._simulation.settings.world.changed(self._given.in_force.values)
        self._simulation.reset(world, starts or {})
        self._keyframes.episode_ns = self._simulation.stamp_ns
        self._world.begin_episode()
        self._entities.begin_episode()
        for each in self._characters:
            each.begin_episode()
        if starts is not None:
            self._publisher.change(self._given.in_force, last_ns if self._begun else None)
        if self._begun:
            self._begin_episode(self._simulation.stamp_ns)

    def _begin_with(self, start: Mapping[str, list[float]]) -> str:
        """Begin a new episode with other values of parameters; why not, empty if so."""
        if reason := self._given.refusal(start):
            return reason
        self.node.set_own_parameters(start)
        self._run_services.reset()
        return ""

    def _change_parameters(self, values: Values) -> None:
        """Take changed parameters, at this tick's boundary."""
        self._settings = NodeSettings.of(values)
        if self._settings.tick_period != self._rate_limiter.period:
            self._rate_limiter.change(self._settings.tick_period, time.monotonic())
        for each in self._characters:
            each.change(self._settings)
        self._initial_states.watch(self._given.in_force, values)

    def _publish_diagnostics(self) -> None:
        if not self._diagnostics.is_heard:
            return
        values: dict[str, object] = {
            "tick": self._simulation.tick,
            "episode": self._simulation.episode,
            "session": self.session,
            "paused": self._control.paused,
            "timeouts": self._timeouts,
            UNLOGGED: self._once_logger.unlogged,
        }
        values |= self._rate_limiter.summary() | self._world.report()
        fault, warning = self._control.fault, self._rate_limiter.take_warning()
        for each in self._characters:
            report, hardware = values | each.report(), each.character.character.name
            self._diagnostics.publish(report, fault, warning, hardware, below=each.name)
