"""What the tests of the nodes share: processes that are always ended, and a node in the test.

Everything waits for a condition with a deadline; nothing sleeps to let something happen.
"""

import math
import os
import signal
import subprocess
import time
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from geometry_msgs.msg import Transform, Vector3, Wrench
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.client import Client as ServiceClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_srvs.srv import SetBool, Trigger

from actuated_characters.runs.processes import MODULES, Child
from msgs_config.character.layout import ROOT
from msgs_config.messages import topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock
from msgs_config.messages.topic import LISTENING_DEPTH, Topic
from tests.support.engines import STANDS_IN
from tests.support.forked import Fork

PATIENCE = 30.0
"""s that a condition may take to come true, on a machine that may be busy with other things."""

RETRY_PERIOD = 0.1
"""s after which a volatile message, whose reader may not have been there, is sent again."""

DDS_PROFILES, RANGE = "FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE"
"""What sets the middleware of the test's own process; the processes under test set it themselves,
by the range LOCALHOST, as a user's do."""

_NOTHING: Mapping[str, object] = {}
_MIDDLEWARE_SAYS = "sequence size exceeds remaining buffer"


def stamp_ns(message: Any) -> int:
    """Stamp of a message with a header, or of one that is a header itself."""
    stamp = getattr(message, "header", message).stamp
    return int(stamp.sec) * NANOSECONDS_PER_SECOND + int(stamp.nanosec)


def tick_of(message: Any, rate_hz: int = 240) -> int:
    """The tick whose stamp a message has."""
    return round(stamp_ns(message) * rate_hz / NANOSECONDS_PER_SECOND)


def wait_until(
    condition: Callable[[], Any],
    what: str,
    patience: float = PATIENCE,
    step: Callable[[], object] = lambda: time.sleep(0.01),
) -> Any:
    """Take a step again and again until the condition gives something true, which is returned."""
    deadline = time.monotonic() + patience
    while not (result := condition()):
        assert time.monotonic() < deadline, f"not within {patience:g} s: {what}"
        step()
    return result


class Process(Child):
    """A process with its output in files; `end` ends it, whatever happens."""

    signal_at_parents_end = signal.SIGKILL
    patience_with_signal = math.inf  # a second one ends a command at once, amid its good order

    def __init__(
        self,
        arguments: Sequence[str],
        log: Path,
        cwd: Path | None = None,
        environment: Mapping[str, str] | None = None,
        forked_module: str | None = None,
    ) -> None:
        """Start `python arguments`, to be killed should the test's own process be.

        With `forked_module` it is `python -m forked_module arguments`, by a fork; see `Fork`.
        """
        self._module, self._output_file = forked_module, log.with_suffix(".stdout")
        own = dict(os.environ if environment is None else environment)
        own |= {"PYTHONUNBUFFERED": "1"}
        if own.pop(DDS_PROFILES, None) and own.get(RANGE) == "SYSTEM_DEFAULT":
            own[RANGE] = "LOCALHOST"
        super().__init__(
            arguments,
            log.with_suffix(".stderr"),
            output=self._output_file,
            environment=own,
            cwd=cwd,
        )

    def _start(
        self, arguments: Sequence[str], environment: dict[str, str], cwd: Path | None
    ) -> Fork | subprocess.Popen[bytes]:
        if self._module is None:
            return super()._start(arguments, environment, cwd)
        folder = cwd or Path.cwd()
        return Fork(self._module, arguments, self._output_file, self._log, folder, environment)

    @property
    def stderr(self) -> str:
        """Its log so far, without the line that says which engine stands in for a missing one."""
        lines = super().stderr.splitlines(keepends=True)
        return "".join(line for line in lines if not line.rstrip().endswith(STANDS_IN))

    @property
    def peak_memory(self) -> float:
        """The most memory that it has had at any time, MB."""
        lines = Path(f"/proc/{self.pid}/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024.0

    def wait(self, patience: float = PATIENCE) -> int:
        """Its exit code, once it has ended by itself."""
        try:
            return self._process.wait(patience)
        except subprocess.TimeoutExpired:
            raise AssertionError(
                f"process {self.pid} did not end within {patience:g} s:\n{self.stderr}"
            ) from None

    def end(self, request: signal.Signals | None = signal.SIGTERM, patience: float = 5.0) -> int:
        """End it if it has not ended yet; returns the exit code."""
        return super().end(request, patience)


LOG_LINES = 220
"""Of a node, however much it is told: a hundred for each kind of input."""


def assert_quiet(process: Process) -> None:
    """It has not said the same again and again, nor anything of endless length."""
    lines = [line for line in process.stderr.splitlines() if line != _MIDDLEWARE_SAYS]
    assert len(lines) < LOG_LINES
    assert sum(map(len, lines)) < 200 * LOG_LINES
    assert "Traceback" not in process.stderr


class Processes:
    """Starts processes in a folder, and ends them all, the last one first.

    Nodes are forked (see `Fork`) unless `fresh`; all others begin as processes do.
    """

    def __init__(self, folder: Path, *, fresh: bool = False) -> None:
        self._folder, self._fresh = folder, fresh
        self._started: list[Process] = []

    def node(
        self, name: str, namespace: str = "", *, fresh: bool = False, **parameters: object
    ) -> Process:
        """Start one of the package's nodes; a name's dots are written as double underscores."""
        return self._start_module(name, {name: parameters}, namespace, fresh=fresh)

    def composed(
        self,
        simulator: Mapping[str, object] = _NOTHING,
        controller: Mapping[str, object] = _NOTHING,
        namespace: str = "",
        *,
        fresh: bool = False,
        **both: object,
    ) -> Process:
        """Start `sim_node` and `controller_node` in one process, with parameters as for `node`."""
        given = {topics.SIM_NODE: simulator, topics.CONTROLLER_NODE: controller}
        parameters = {name: {"character": "pendulum", **both, **given[name]} for name in given}
        return self._start_module("composed", parameters, namespace, fresh=fresh)

    def _start_module(
        self,
        name: str,
        parameters: Mapping[str, Mapping[str, object]],
        namespace: str,
        *,
        fresh: bool,
    ) -> Process:
        content = {
            f"/**/{node}": {
                "ros__parameters": {key.replace("__", "."): each for key, each in given.items()}
            }
            for node, given in parameters.items()
        }
        file = self._folder / f"{len(self._started)}_{name}.yaml"
        file.write_text(yaml.safe_dump(content))
        arguments = ["--ros-args", "--params-file", str(file)]
        arguments += ["-r", f"__ns:=/{namespace}"] if namespace else []
        if self._fresh or fresh:
            return self.python("-m", MODULES[name], *arguments)
        return self._start(arguments, forked_module=MODULES[name])

    def simulator(self, character: str = "pendulum", **parameters: object) -> Process:
        """Start `sim_node`."""
        return self.node(topics.SIM_NODE, character=character, **parameters)

    def controller(self, character: str = "pendulum", **parameters: object) -> Process:
        """Start `controller_node`."""
        return self.node(topics.CONTROLLER_NODE, character=character, **parameters)

    def command(self, *arguments: str, environment: Mapping[str, str] | None = None) -> Process:
        """Start the command line `actuated_characters`."""
        return self.python("-m", "actuated_characters.cli", *arguments, environment=environment)

    def python(self, *arguments: str, environment: Mapping[str, str] | None = None) -> Process:
        """Start Python in the folder."""
        return self._start(arguments, environment)

    def _start(
        self,
        arguments: Sequence[str],
        environment: Mapping[str, str] | None = None,
        forked_module: str | None = None,
    ) -> Process:
        log = self._folder / f"process_{len(self._started)}"
        process = Process(arguments, log, self._folder, environment, forked_module)
        self._started.append(process)
        return process

    def end(self) -> None:
        """End all, and print what they said: pytest shows it where a test has failed."""
        for process in reversed(self._started):
            process.end()
        for process in self._started:
            print(f"--- process {process.pid}, exit code {process.exit_code}")
            print(process.stdout, process.stderr, sep="")


@dataclass
class ReceivedMessages:
    """What has come on a topic, oldest first."""

    messages: list[Any] = field(default_factory=list)  # which a test may clear
    raw: list[bytes] = field(default_factory=list)
    sent_ns: list[int] = field(default_factory=list)  # wall time
    _seen: list[Any] = field(default_factory=list)  # messages that have been looked at
    _first: dict[int, Any] = field(default_factory=dict)  # by stamp, ns

    def __len__(self) -> int:
        return len(self.messages)

    @property
    def last(self) -> Any:
        """The newest message."""
        return self.messages[-1]

    def of_stamp(self, stamp: int) -> Any | None:
        """The first message with a stamp in ns, of which there are thousands to choose from."""
        if self._seen and not (self.messages and self.messages[0] is self._seen[0]):
            self._seen.clear()
            self._first.clear()
        for message in self.messages[len(self._seen) :]:
            self._seen.append(message)
            self._first.setdefault(stamp_ns(message), message)
        return self._first.get(stamp)

    def ticks(self) -> list[int]:
        """The ticks of the messages, at the default rate."""
        return [tick_of(message) for message in self.messages]

    def by_tick(self) -> dict[int, Any]:
        """Each tick's message, at the default rate; one that came twice counts once."""
        return {tick_of(message): message for message in self.messages}


class Client:
    """A node in the test's own process."""

    def __init__(self, context: Context, name: str = "test_client") -> None:
        self.node = Node(name, context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self._clients: dict[str, ServiceClient] = {}
        self._take_waiting: list[Callable[[], None]] = []

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.node.destroy_node()

    def listen(self, topic: Topic, qos: QoSProfile | None = None) -> ReceivedMessages:
        """Subscribe to a topic."""
        inbox = ReceivedMessages()

        def keep(raw: bytes, info: dict[str, int]) -> None:
            inbox.raw.append(raw)
            inbox.sent_ns.append(info["source_timestamp"])
            inbox.messages.append(deserialize_message(raw, topic.message_type))

        subscription = self.node.create_subscription(
            topic.message_type, topic.name, keep, qos or topic.for_listener().qos, raw=True
        )

        def take_waiting() -> None:
            # At most as many as the reader holds: a publisher may be quicker than this loop.
            for _ in range(LISTENING_DEPTH):
                taken = subscription.handle.take_message(topic.message_type, True)
                if taken is None:
                    return
                keep(*taken)

        self._take_waiting.append(take_waiting)
        return inbox

    def speak(self, topic: Topic, qos: QoSProfile | None = None) -> Publisher:
        """Publish on a topic."""
        return self.node.create_publisher(topic.message_type, topic.name, qos or topic.qos)

    def spin_until(
        self, condition: Callable[[], Any], what: str, patience: float = PATIENCE
    ) -> Any:
        """Receive messages until the condition gives something true, which is returned."""
        return wait_until(condition, what, patience, self._spin_once)

    def _spin_once(self) -> None:
        """Wait for something to do, and take all messages that have come.

        The executor takes one at a turn, which is slower than a simulation that runs free: its
        messages would pile up until the middleware drops the oldest.
        """
        self._executor.spin_once(0.02)
        for take_waiting in self._take_waiting:
            take_waiting()

    def spin_sending(
        self, send: Callable[[], None], condition: Callable[[], Any], what: str
    ) -> Any:
        """Send something again and again until the condition gives something true."""
        next_time = 0.0

        def step() -> None:
            nonlocal next_time
            if time.monotonic() >= next_time:
                send()
                next_time = time.monotonic() + RETRY_PERIOD
            self._spin_once()

        return wait_until(condition, what, step=step)

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """Call a service, and return its response."""
        future = self.begin_call(service_type, name, request)
        self.spin_until(future.done, f"response of {name}")
        return future.result()

    def begin_call(self, service_type: Any, name: str, request: Any) -> Future:
        """Call a service whose response may take long; it is the result of what is returned."""
        if name not in self._clients:  # one that is new has to be discovered first
            self._clients[name] = self.node.create_client(service_type, name)
        client = self._clients[name]
        self.spin_until(client.service_is_ready, f"service {name}")
        return client.call_async(request)

    def get_parameters(self, node: str, names: list[str]) -> list[Any]:
        """Values of a node's parameters."""
        request = GetParameters.Request(names=names)
        response = self.call(GetParameters, f"{node}/get_parameters", request)
        return [Parameter.from_parameter_msg(_named(value)).value for value in response.values]

    def list_parameters(self, node: str) -> list[str]:
        """Names of a node's parameters."""
        response = self.call(ListParameters, f"{node}/list_parameters", ListParameters.Request())
        return list(response.result.names)

    def set_parameter(self, node: str, name: str, value: object) -> tuple[bool, str]:
        """Set a node's parameter; whether it was taken, and the reason if not."""
        message = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[message])
        (result,) = self.call(SetParameters, f"{node}/set_parameters", request).results
        return result.successful, result.reason


def _named(value: Any) -> ParameterMessage:
    return ParameterMessage(name="", value=value)


def joint_state(
    stamp: int,
    names: Sequence[str],
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> JointState:
    """A JointState stamped in ns."""
    message = JointState(
        name=list(names),
        position=array("d", position),
        velocity=array("d", velocity),
        effort=array("d", effort),
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NANOSECONDS_PER_SECOND)
    return message


def wrench_message(
    stamp: int,
    wrenches: Sequence[tuple[str, Sequence[float]]],
    points: Sequence[Sequence[float]] = (),
) -> MultiDOFJointState:
    """Force and torque (6,) on links, stamped in ns, and where the forces act."""
    message = MultiDOFJointState(
        joint_names=[link for link, _ in wrenches],
        wrench=[Wrench(force=_vector(w[:3]), torque=_vector(w[3:])) for _, w in wrenches],
        transforms=[Transform(translation=_vector(point)) for point in points],
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NANOSECONDS_PER_SECOND)
    return message


def _vector(values: Sequence[float]) -> Vector3:
    x, y, z = values
    return Vector3(x=float(x), y=float(y), z=float(z))


class SimulatorClient(Client):
    """Stands where a controller stands: hears the simulator, and commands it."""

    def __init__(self, context: Context, name: str = "test_client", below: str = "") -> None:
        """Stand at the topics of the one character, or of that whose namespace is `below`."""
        super().__init__(context, name)
        self.clock = self.listen(topics.CLOCK)
        self.episodes = self.listen(topics.EPISODE.under(below))
        configuration = topics.CONFIGURATION.of(topics.SIM_NODE)
        self.configuration = self.listen(configuration.under(below))
        self.diagnostics = self.listen(topics.DIAGNOSTICS)
        self.torques = self.speak(topics.JOINT_TORQUES.under(below))
        self.wrenches = self.speak(topics.EXTERNAL_WRENCH.under(below))
        self.states = self.listen(topics.JOINT_STATES.under(below))

    def state(self, tick: int, patience: float = PATIENCE) -> JointState:
        """The state of a tick, once it has come; at the default rate."""
        stamp = TickClock(240).stamp_ns(tick)
        return self.spin_until(
            lambda: self.states.of_stamp(stamp), f"state of tick {tick}", patience
        )

    def first_state(self, listeners: int = 1) -> JointState:
        """The state of tick 1, once so many hear commands and pushes: the simulator, a recorder."""
        for publisher in (self.torques, self.wrenches):
            self.spin_until(
                lambda publisher=publisher: publisher.get_subscription_count() >= listeners,
                f"{listeners} that listen to commands and pushes",
            )
        return self.state(1)

    def command(self, stamp: int, efforts: Mapping[str, float]) -> None:
        """Command some degrees of freedom."""
        self.torques.publish(joint_state(stamp, list(efforts), effort=list(efforts.values())))

    def advance(self, state: JointState, efforts: Mapping[str, float]) -> JointState:
        """Command every motor, with zero where nothing is said; gives the state that follows."""
        motors = [name for name in state.name if not name.startswith(f"{ROOT}_")]
        self.command(stamp_ns(state), dict.fromkeys(motors, 0.0) | dict(efforts))
        return self.state(tick_of(state) + 1)

    def drive(self, state: JointState, ticks: int, rng: np.random.Generator) -> JointState:
        """Command every motor at random for some ticks; gives the state that follows."""
        motors = [name for name in state.name if not name.startswith(f"{ROOT}_")]
        for _ in range(ticks):
            torques = rng.uniform(-20.0, 20.0, len(motors)).tolist()
            state = self.advance(state, dict(zip(motors, torques, strict=True)))
        return state

    def reported(self, *, answering: JointState | None = None, **expected: object) -> Any:
        """The first report on /diagnostics with these values (as texts), once it has come.

        With a state to be `answering` it goes on from there meanwhile: pushes and throws are taken
        between two ticks alone.
        """

        def found() -> Any:
            for array_message in self.diagnostics.messages:
                for status in array_message.status:
                    values = {item.key: item.value for item in status.values}
                    if values.items() >= {k: str(v) for k, v in expected.items()}.items():
                        return status
            return None

        def step() -> None:
            nonlocal answering
            if answering is None:
                self._spin_once()
            else:
                answering = self.advance(answering, {})

        return wait_until(found, f"a report of {expected}", PATIENCE, step)

    def pause(self, paused: bool) -> SetBool.Response:
        """Call the simulator's service `~/pause`."""
        return self.call(SetBool, f"{topics.SIM_NODE}/pause", SetBool.Request(data=paused))

    def step(self) -> Future:
        """Begin a call of the simulator's service `~/step`."""
        return self.begin_call(Trigger, f"{topics.SIM_NODE}/step", Trigger.Request())

    def reset(self) -> Trigger.Response:
        """Call the simulator's service `~/reset`."""
        return self.call(Trigger, f"{topics.SIM_NODE}/reset", Trigger.Request())


class ControllerClient(Client):
    """Stands where the simulator stands: publishes states, and hears what answers them."""

    def __init__(self, context: Context) -> None:
        super().__init__(context, "test_simulator")
        self.references = self.listen(topics.REFERENCE.of(topics.CONTROLLER_NODE))
        self.configuration = self.listen(topics.CONFIGURATION.of(topics.CONTROLLER_NODE))
        self.torques = self.listen(topics.JOINT_TORQUES)
        self.states = self.speak(topics.JOINT_STATES)
        self.episodes = self.speak(topics.EPISODE)

    def ask(self, state: JointState) -> JointState:
        """The torques that answer a state, which is sent until it is answered."""
        stamp = stamp_ns(state)
        return self.send(state, lambda: self.torques.of_stamp(stamp))

    def reference(self, state: JointState) -> JointState:
        """The reference of a state that was answered."""
        return self.spin_until(lambda: self.references.of_stamp(stamp_ns(state)), "its reference")

    def send(self, state: JointState, condition: Callable[[], Any]) -> Any:
        """Send a state again and again until the condition gives something true."""
        stamp = stamp_ns(state)
        return self.spin_sending(
            lambda: self.states.publish(state), condition, f"an answer to the state of {stamp} ns"
        )
