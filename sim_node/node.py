"""`sim_node`: the simulation at one end of the topics, in lockstep with whoever commands it."""

import time

import numpy as np
from rclpy.node import Node
from std_srvs.srv import SetBool

from msgs_config import configuration, topics
from msgs_config.character_loading import load_character
from msgs_config.diagnostics import DiagnosticsPublisher
from msgs_config.errors import CommandError, LayoutError, MessageError, SimulationError
from msgs_config.messages import JointStateDecoder
from msgs_config.node_parameters import declare, given_parameters
from msgs_config.parameters import resolve
from msgs_config.polling import DirectSubscription, Spinner
from msgs_config.process import StopSignal
from msgs_config.shared_parameters import DEFAULT_CHARACTER
from msgs_config.warnings import Warnings
from sim_node.lockstep import LockstepBarrier, Verdict
from sim_node.outputs import Outputs
from sim_node.parameters import PARAMETERS, character_parameters, make_settings
from sim_node.patience import Due, Patience
from sim_node.simulation import FIRST_TICK, Simulation
from sim_node.tick_times import TickTimes
from sim_node.waiting import describe_waiting, publisher_names

_EXPLAIN_AFTER = 2.0  # s without a complete command before the node says what is missing
_DIAGNOSTICS_PERIOD = 1.0  # s of wall time
_FLUSH_TIME = 10.0  # s that subscribers may take to acknowledge the last messages
_STOP_FLUSH_TIME = 0.5  # s, after a signal or an error


class SimNode(Node):
    """Publishes the state of each tick; goes on when every commanded joint has its answer."""

    def __init__(self) -> None:
        """Read the parameters, build the world, and offer the topics.

        Raises:
            ActuatedCharactersError: a parameter or the character cannot be used.
        """
        super().__init__(topics.SIM_NODE)
        given = given_parameters(self)
        character = load_character(str(given.get("character", DEFAULT_CHARACTER)))
        parameters = PARAMETERS + character_parameters(character)
        values = resolve(parameters, given)
        self._simulation = Simulation(character, make_settings(values))
        declare(self, parameters, values)
        self._values = values
        self._max_ticks = values.integer("max_ticks")
        self._barrier = LockstepBarrier(character.layout.dof_names, self._simulation.commanded)
        self._patience = Patience(
            republish_period=values.number("republish_period"),
            explain_after=_EXPLAIN_AFTER,
            timeout=values.number("lockstep_timeout"),
        )
        self._decoder = JointStateDecoder()
        self._commands = DirectSubscription(self, topics.JOINT_TORQUES)
        self._outputs = Outputs(self, character.layout)
        self._outputs.publish_configuration(configuration.describe(character, values))
        self._diagnostics = DiagnosticsPublisher(self)
        self._next_diagnostics = 0.0
        self.create_service(SetBool, "~/pause", self._on_pause)
        self._paused = False
        self._fault: str | None = None
        self._diverged = False
        self._last_effort = self._barrier.effort
        self._timeouts = 0
        self._tick_times = TickTimes()
        self._warnings = Warnings(self)
        self._begun = False

    def run(self, stop: StopSignal) -> None:
        """Simulate until `max_ticks`, or until `stop`.

        Raises:
            SimulationError: a fault or a timeout whose parameter says `abort`.
        """
        spinner = Spinner(self)
        try:
            self._wait_for_subscribers(stop, spinner)
            self._outputs.publish_episode(1, self._simulation.state.stamp_ns)
            self._begin_tick()
            while not stop and not self._finished:
                self._turn(spinner)
        finally:
            self._flush(_FLUSH_TIME if self._finished else _STOP_FLUSH_TIME)
            spinner.close()
            self._simulation.close()

    @property
    def _finished(self) -> bool:
        ticks = self._simulation.tick - FIRST_TICK
        return not self._diverged and 0 < self._max_ticks <= ticks

    def _wait_for_subscribers(self, stop: StopSignal, spinner: Spinner) -> None:
        wanted = self._values.integer("wait_for_subscribers")
        self._patience.restart(time.monotonic())
        while not stop and (found := self._outputs.state_subscribers) < wanted:
            spinner.rest()
            if Due.EXPLAIN in self._patience.due(time.monotonic()):
                sentence = f"waiting for {wanted} subscribers of joint_states; there are {found}"
                self.get_logger().warning(f"{sentence}; has one not started, or ended?")

    def _turn(self, spinner: Spinner) -> None:
        """Take a command or rest, and advance if the tick is complete."""
        raw = self._commands.take()
        if raw is None:
            spinner.rest()
        else:
            spinner.received()
            spinner.serve()  # a flood of commands must not keep services waiting
            self._take_command(raw)
        if self._barrier.complete and not self._paused:
            self._advance()  # before the clock: a command that came in time is no timeout
        self._look_at_the_clock()

    def _flush(self, seconds: float) -> None:
        """Publish the last report, and wait until every subscriber has all that was published."""
        self._publish_diagnostics()
        deadline = time.monotonic() + seconds
        flushed = self._outputs.flush(seconds)
        if not (flushed and self._diagnostics.flush(deadline - time.monotonic())):
            self.get_logger().warning("a subscriber has not acknowledged the last messages")

    def _begin_tick(self) -> None:
        self._begun = True
        state = self._simulation.state
        self._barrier.open(state.stamp_ns)
        self._patience.restart(time.monotonic())
        self._outputs.publish_state(state)

    def _advance(self) -> None:
        self._last_effort = self._barrier.effort
        try:
            self._simulation.step(self._last_effort)
        except SimulationError as error:
            self._diverged = True
            self._raise_fault(str(error))
            return
        self._tick_times.tick()
        self._begin_tick()

    def _take_command(self, raw: bytes) -> None:
        try:
            command = self._decoder.decode(raw)
            indices = self._simulation.layout.indices(command.names)
            verdict = self._barrier.offer(command.stamp_ns, indices, command.effort)
        except (MessageError, LayoutError, CommandError) as error:
            self._barrier.count_rejected()
            self._warnings.say_once(f"command rejected: {error}")
            return
        if verdict is Verdict.FUTURE or command.stamp_ns == 0:
            self._warnings.say_once(
                f"command dropped: it answers {command.stamp_ns} ns, the state is of "
                f"{self._barrier.stamp_ns} ns; the stamp must be that of the state"
            )
        if verdict is Verdict.CONFLICT and not self._paused:
            senders = ", ".join(publisher_names(self, topics.JOINT_TORQUES))
            self._raise_fault(
                f"two different commands for '{self._barrier.conflict}' at one tick; "
                f"'{topics.JOINT_TORQUES.name}' is published by {senders}"
            )

    def _look_at_the_clock(self) -> None:
        now = time.monotonic()
        if now >= self._next_diagnostics:
            self._next_diagnostics = now + _DIAGNOSTICS_PERIOD
            self._publish_diagnostics()
        for due in [] if self._paused else self._patience.due(now):
            if due is Due.REPUBLISH:
                self._outputs.republish_state()
            elif due is Due.EXPLAIN:
                missing = self._barrier.missing
                self.get_logger().warning(describe_waiting(self, topics.JOINT_TORQUES, missing))
            elif self._simulation.tick > FIRST_TICK:  # before the first command it just waits
                self._on_timeout()

    def _on_timeout(self) -> None:
        action = self._values.text("on_timeout")
        sentence = describe_waiting(self, topics.JOINT_TORQUES, self._barrier.missing)
        sentence = f"no command within {self._patience.timeout:g} s; {sentence}"
        if action == "abort":
            self._fault = sentence
            raise SimulationError(sentence)
        self.get_logger().warning(f"{sentence}; on_timeout: {action}")
        if action == "pause":
            self._pause(sentence)
        else:
            fill = self._last_effort if action == "hold" else np.zeros_like(self._last_effort)
            self._barrier.fill_missing(fill)
            self._timeouts += 1

    def _raise_fault(self, sentence: str) -> None:
        self._fault = sentence
        if self._values.text("on_fault") == "abort":
            raise SimulationError(sentence)
        self.get_logger().error(f"{sentence}; paused")
        self._pause(sentence)

    def _pause(self, fault: str) -> None:
        self._paused = True
        self._fault = fault
        self._publish_diagnostics()

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._diverged and not request.data:
            response.success, response.message = False, f"cannot go on: {self._fault}"
            return response
        resumes = self._paused and not request.data
        self._paused = request.data
        if resumes and self._begun:
            self._fault = None
            self._tick_times.resume()
            self._begin_tick()  # what was collected before the pause is asked for again
        response.success, response.message = True, "paused" if self._paused else "running"
        return response

    def _publish_diagnostics(self) -> None:
        if not self._diagnostics.is_heard:
            return
        counts = self._barrier.counts
        values: dict[str, object] = {"tick": self._simulation.tick, "paused": self._paused}
        values |= {verdict.value: counts[verdict] for verdict in Verdict}
        values["timeouts"] = self._timeouts
        values |= self._tick_times.summary()
        self._diagnostics.publish(values, self._fault)
