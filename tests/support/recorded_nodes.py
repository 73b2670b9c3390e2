"""Recordings by real nodes to which much happens, for tests of what comes again."""

import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

import yaml
from rclpy.context import Context
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.runs.in_process import run_together
from actuated_characters.runs.perturbation_node import PerturbationNode
from actuated_characters.runs.planned.files import write_planned
from actuated_characters.runs.planned.pins import PlannedPin
from msgs_config.character.file import CHARACTERS_DIRECTORY
from msgs_config.messages import topics
from tests.support.physics import character
from tests.support.ros import Client, Processes, SimulatorClient, wrench_message

RATE = 480  # Hz: delayed, the humanoid needs a fast one
TICKS = 160
DELAY = 2
CHEST_LIMIT = 3.0  # N m, of a ball joint: far less than the law asks for
EXAMPLE = Path(__file__).parents[2] / "examples" / "pd_controller.py"


@contextmanager
def recorded(directory: Path, **parameters: object) -> Iterator[Processes]:
    """Starts processes that are recorded into a directory until the end of the context."""
    directory.mkdir()
    processes = Processes(directory)
    try:
        recorder = processes.node(
            topics.RECORDER_NODE, directory=str(directory / "run"), **parameters
        )
        yield processes
        recorder.send(signal.SIGINT)
        assert recorder.wait() == 0, recorder.stderr
    finally:
        processes.end()


def weakened(folder: Path, name: str, joint: str, limit: float) -> str:
    """The file of a character whose joint has an effort limit, in N m."""
    content = yaml.safe_load((CHARACTERS_DIRECTORY / f"{name}.yaml").read_text())
    if (CHARACTERS_DIRECTORY / content["urdf"]).is_file():  # else it is a package's
        content["urdf"] = str(CHARACTERS_DIRECTORY / content["urdf"])
    content["joints"][joint]["effort_limit"] = limit
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump(content))
    return str(file)


def record_eventful(folder: Path, context: Context) -> Path:
    """Late and clipped commands, pushes, changed gains, pauses, a reset, trajectories."""
    own = weakened(folder, "humanoid", "chest", CHEST_LIMIT)
    client = SimulatorClient(context)
    trajectories = client.speak(topics.JOINT_TRAJECTORY.of(topics.CONTROLLER_NODE))
    strengths = client.speak(topics.STRENGTH.of(topics.CONTROLLER_NODE))
    node, simulator_node = topics.CONTROLLER_NODE, topics.SIM_NODE

    def push(link: str, *point: float) -> None:
        wrench = (80.0, -30.0, 10.0, 1.0, 2.0, 3.0)
        client.wrenches.publish(wrench_message(0, [(link, wrench)], [point] if point else []))
        assert client.wrenches.wait_for_all_acked()

    def change(**values: object) -> None:
        for name, value in values.items():
            assert client.set_parameter(node, name.replace("__", "."), value) == (True, "")

    def step(count: int) -> None:
        assert client.set_parameter(simulator_node, "step_count", count) == (True, "")
        steps = client.step()
        client.spin_until(steps.done, f"{count} steps")
        assert steps.result().success, steps.result().message

    with recorded(folder / "eventful") as processes:
        simulator = processes.simulator(
            own,
            commanded_joints=["root", *character("humanoid").layout.actuated_joint_names],
            rate=RATE,
            command_delay_ticks=DELAY,
            speed_limit=1e5,
            wrench_duration=0.02,
            max_ticks=TICKS,
            wait_for_subscribers=4,
        )
        processes.controller(own, rate=RATE, reference="clip", wait_for_subscribers=2)
        client.spin_until(
            lambda: trajectories.get_subscription_count() == 2, "who hears trajectories"
        )
        client.spin_until(lambda: strengths.get_subscription_count() == 2, "who hears strengths")
        assert client.pause(True).success
        client.listen(topics.JOINT_STATES)  # is the fourth, without whom nothing begins
        client.spin_until(lambda: client.states.messages, "the first state")
        step(10)
        push("chest", 0.01, 0.02, -0.03)
        push("right_knee")
        change(gains__chest__p=700.0)
        strengths.publish(a_strength("left_knee", 0.3))
        step(25)
        change(law="zero", gain_scale__p=0.8)
        trajectories.publish(a_step("left_elbow", 0.5))
        step(30)
        push("left_wrist")
        step(4)
        assert client.reset().success
        step(30)
        push("chest")
        trajectories.publish(a_step("right_elbow", 0.7))
        strengths.publish(a_strength("chest", 0.5))
        change(law="stable_pd", gains__chest__p=900.0)
        assert client.pause(False).success
        assert simulator.wait() == 0
    client.close()
    return folder / "eventful" / "run"


def a_step(dof: str, position: float) -> JointTrajectory:
    """To a position within a tenth of a second, from the next answered state on."""
    point = JointTrajectoryPoint(positions=[position])
    point.time_from_start.nanosec = 10**8
    return JointTrajectory(joint_names=[dof], points=[point])


def a_strength(joint: str, share: float) -> JointState:
    """Of a joint, from the next answered state on."""
    return JointState(name=[joint], effort=[share])


def record_foreign(folder: Path) -> Path:
    """The pendulum under somebody's own controller."""
    with recorded(folder / "foreign") as processes:
        simulator = processes.simulator(max_ticks=60, wait_for_subscribers=2)
        all_heard = ("--ros-args", "-p", "wait_for_subscribers:=2")
        processes.python(str(EXAMPLE), *all_heard)
        assert simulator.wait() == 0
    return folder / "foreign" / "run"


def record_realtime(folder: Path, context: Context) -> Path:
    """The pendulum by the wall clock, its commands clipped."""
    own = weakened(folder, "pendulum", "hinge", 2.0)
    client = Client(context)
    states = client.listen(topics.JOINT_STATES)
    with recorded(folder / "realtime") as processes:
        simulator = processes.simulator(
            own, mode="realtime", wait_for_subscribers=3, command_delay_ticks=1
        )
        processes.controller(own, wait_for_subscribers=2)

        def driven() -> bool:
            return sum(map(any, (message.effort for message in states.messages))) > 60

        client.spin_until(driven, "ticks with an effort")
        simulator.send(signal.SIGINT)
        assert simulator.wait() == 0
    client.close()
    return folder / "realtime" / "run"


PAIR = ["left", "right"]
_PLACES = {"left": [0.0] * 4, "right": [0.0, 2.0, 0.0, 0.5]}
_WORLD_OF_PAIR: dict[str, object] = {
    **{"characters": PAIR, "character": "pendulum", "max_ticks": 40, "wait_for_subscribers": 2},
    **{"right.placement": _PLACES["right"], "right.initial_position": [0.3]},
}


def _one_of_pair(name: str) -> dict[str, object]:
    return {"character": "pendulum", "placement": _PLACES[name], "wait_for_subscribers": 2}


def record_pair(folder: Path) -> Path:
    """Two pendulums in one world."""
    with recorded(folder / "pair", characters=PAIR) as processes:
        simulator = processes.simulator(**_WORLD_OF_PAIR)
        for name in PAIR:
            processes.node(topics.CONTROLLER_NODE, name, **_one_of_pair(name))
        assert simulator.wait() == 0
    return folder / "pair" / "run"


def record_pair_in_process(
    folder: Path, pins: Mapping[str, Sequence[PlannedPin]] = MappingProxyType({})
) -> Path:
    """The same two pendulums, with all nodes in this process, and pins by their names."""
    directory = folder / "alone"
    prepare_directory(directory, overwrite=False)
    write_planned(directory / "nothing.json", [])
    senders: dict[str, Mapping[str, object]] = {}
    for name, planned in pins.items():
        write_planned(directory / f"{name}.json", planned)
        files = {"pins": str(directory / f"{name}.json"), "pin_subscribers": 2}
        senders[f"{name}/pusher"] = {"file": str(directory / "nothing.json"), **files}
    given = {
        **senders,
        topics.RECORDER_NODE: {"characters": PAIR, "directory": str(directory)},
        **{f"{name}/{topics.CONTROLLER_NODE}": _one_of_pair(name) for name in PAIR},
        topics.SIM_NODE: _WORLD_OF_PAIR,
    }
    run_together(given, directory, makers={"pusher": PerturbationNode})
    return directory
