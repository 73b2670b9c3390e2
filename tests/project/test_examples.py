"""Each example as a user runs it: with a simulator, over topics; and what physics says of it."""

import ast
import math
import re
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from msgs_config.arrays import FloatArray
from msgs_config.character.sensors import SensorType
from msgs_config.geometry import rotations
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from tests.support import physics
from tests.support.ros import (
    Processes,
    ReceivedMessages,
    SimulatorClient,
    tick_of,
    wait_until,
    wrench_message,
)

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = sorted(EXAMPLES.glob("*.py"))
INTERRUPTIBLE = {
    "pd_controller": (),
    "two_controllers": ("--part", "arms"),
    "push": ("--link", "rod", "--force", "1", "0", "0"),
    "step_response": (),
    "balance": (),
}
MAY_IMPORT = {"numpy", "rclpy", "sensor_msgs", "geometry_msgs"} | set(sys.stdlib_module_names)
LONG = 120.0  # s that a thousand ticks of three processes may take on a busy machine
QUIET = 0.2  # s within which a process that waits uses no processor
SOON = 0.05  # s, a republish period for tests that wait for repeated states


def example(name: str) -> str:
    return str(EXAMPLES / f"{name}.py")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_an_example_needs_ros_and_numpy_alone_and_says_how_it_is_run(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"))

    imports = {alias.name for n in ast.walk(tree) if isinstance(n, ast.Import) for alias in n.names}
    imports |= {str(n.module) for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert {name.partition(".")[0] for name in imports} <= MAY_IMPORT
    assert f".venv/bin/python examples/{file.name}" in (ast.get_docstring(tree) or "")


def listeners(client: SimulatorClient) -> set[str]:
    """The nodes that hear a simulator."""
    found = [
        client.node.get_subscriptions_info_by_topic(topic.name)
        for topic in (topics.JOINT_STATES, topics.APPLIED_WRENCH)
    ]
    return {info.node_name for infos in found for info in infos}


def waits(pid: int) -> bool:
    """Whether a process has come to wait: a signal while rclpy is set up makes rclpy say things."""
    before = cpu_ticks(pid)
    time.sleep(QUIET)
    return cpu_ticks(pid) - before <= 1


def cpu_ticks(pid: int) -> int:
    """What a process has used of the processor, in hundredths of a second."""
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return int(fields[11]) + int(fields[12])


@pytest.mark.parametrize(
    ("name", "number"),
    [
        pytest.param(name, number, marks=[] if (at + number) % 2 else pytest.mark.nightly)
        for at, name in enumerate(INTERRUPTIBLE)
        for number in (signal.SIGINT, signal.SIGTERM)
    ],
)
def test_an_example_ends_quietly_on_a_signal(
    processes: Processes, client: SimulatorClient, name: str, number: signal.Signals
) -> None:
    started = processes.python(example(name), *INTERRUPTIBLE[name])
    client.spin_until(lambda: listeners(client) - {"test_client"}, "an example that listens")
    client.spin_until(lambda: waits(started.pid), "an example that waits")

    started.send(number)

    assert started.wait() in (0, 1)  # 1 if what it was there for has not happened
    assert (started.stdout, started.stderr) == ("", "")


def turn_at(
    client: SimulatorClient, clock: Publisher, velocities: ReceivedMessages, second: int
) -> float:
    """The turn rate that the driver publishes at a simulated time."""
    before, message = len(velocities), Clock()
    message.clock.sec = second
    client.spin_sending(
        lambda: clock.publish(message), lambda: len(velocities) > before, "a velocity"
    )
    return float(velocities.last.angular.z)


def test_the_driver_steers_by_simulated_time(processes: Processes, client: SimulatorClient) -> None:
    velocities = client.listen(topics.CMD_VEL)
    clock = client.speak(topics.CLOCK)
    driver = processes.python(example("drive"))
    client.spin_until(clock.get_subscription_count, "the driver, which hears the clock")
    turns = [turn_at(client, clock, velocities, second) for second in (1, 5, 13, 26)]

    driver.send(signal.SIGINT)

    assert driver.wait() == 0
    assert (driver.stdout, driver.stderr) == ("", "")
    assert turns == [0.5, 0.5, -0.5, 0.5]  # circles of 12.6 s
    assert velocities.last.linear.x == 0.8


# The example, to which a signal comes in the moment between the look at the context and the wait.
JUST_BEFORE_A_WAIT = """
import os, runpy, signal, sys, time
import rclpy, rclpy.executors
real = rclpy.executors._rclpy
class Rcl:
    def __getattr__(self, name):
        if name == "WaitSet" and rclpy.ok():
            os.kill(os.getpid(), signal.SIGTERM)
            while rclpy.ok():
                time.sleep(0.001)
        return getattr(real, name)
rclpy.executors._rclpy = Rcl()
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.mark.parametrize("name", INTERRUPTIBLE)
def test_a_signal_just_before_a_wait_is_a_signal(processes: Processes, name: str) -> None:
    started = processes.python("-c", JUST_BEFORE_A_WAIT, example(name), *INTERRUPTIBLE[name])

    assert started.wait() in (0, 1)
    assert (started.stdout, started.stderr) == ("", "")


def test_the_pd_controller_with_gravity_compensation_comes_to_rest_at_its_target(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.python(example("pd_controller"), "--ros-args", "-p", "target:=0.7")
    simulator = processes.simulator(max_ticks=720, wait_for_subscribers=2)

    last = client.state(721)

    assert simulator.wait() == 0
    assert last.position[0] == pytest.approx(0.7, abs=1e-6)
    assert last.velocity[0] == pytest.approx(0.0, abs=1e-6)
    assert last.effort[0] == pytest.approx(9.81 * 0.5 * math.sin(0.7), abs=1e-4)


def test_two_controllers_bring_every_joint_to_its_target_and_move_no_centre_of_mass(
    processes: Processes, client: SimulatorClient
) -> None:
    torques = client.listen(topics.JOINT_TORQUES)
    settings = {"rate": 500, "gravity": 0.0, "terrain": "none", "republish_period": SOON}
    simulator = processes.simulator("humanoid", max_ticks=1500, **settings)
    client.spin_until(client.torques.get_subscription_count, "a simulator that listens")
    first = client.spin_until(lambda: client.states.messages and client.states.last, "a state")

    processes.python(example("two_controllers"), "--part", "arms")
    client.spin_until(lambda: len(torques) > 3, "commands of the arms")
    assert {tick_of(state, 500) for state in client.states.messages} == {1}  # the legs are missing

    processes.python(example("two_controllers"), "--part", "legs")
    last = client.spin_until(
        lambda: tick_of(client.states.last, 500) == 1501 and client.states.last,
        "the last state",
        LONG,
    )
    assert simulator.wait() == 0

    commanded = [tuple(message.name) for message in torques.messages]
    arms, legs = sorted(set(commanded))
    assert set(arms) | set(legs) == {n for n in last.name if not n.startswith("root_")}
    goals = {**goals_of("arms"), **goals_of("legs")}
    for joint, target in goals.items():
        reached = [
            value
            for name, value in zip(last.name, last.position, strict=True)
            if name.removesuffix("_x").removesuffix("_y").removesuffix("_z") == joint
        ]
        assert angle(reached, target) < 0.005, joint
    centre, velocity = centre_of_mass(last)
    # the base moves 150 mm; what is left is the integration's error, of first order in the period
    assert centre == pytest.approx(centre_of_mass(first)[0], abs=0.012)
    assert velocity == pytest.approx(np.zeros(3), abs=0.005)


def goals_of(part: str) -> dict[str, list[float]]:
    """The targets that stand in the example, by joint."""
    tree = ast.parse((EXAMPLES / "two_controllers.py").read_text(encoding="utf-8"))
    value = next(
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "GOALS"
    )
    return {joint: target for joint, (target, _) in ast.literal_eval(value)[part].items()}


def angle(reached: list[float], target: list[float]) -> float:
    """Angle in rad between two positions of a hinge or ball joint."""
    if len(target) == 1:
        return abs(reached[0] - target[0])
    between = rotations.angle_between(
        rotations.exp(np.array(reached)), rotations.exp(np.array(target))
    )
    return float(between)


def centre_of_mass(state: JointState) -> tuple[FloatArray, FloatArray]:
    """Position in m and velocity in m/s of the humanoid's centre of mass."""
    humanoid = physics.character("humanoid")
    with physics.still_world(humanoid) as world:
        world.body.set_state(np.array(state.position), np.array(state.velocity))
        motions = physics.link_motions(world.body, humanoid)
        linear, _ = physics.momentum(world.body, humanoid)
    weighted = sum(motion.mass * motion.centre for motion in motions)
    return weighted / humanoid.mass, linear / humanoid.mass


@pytest.mark.nightly
@pytest.mark.parametrize(("pushed", "heading"), [(1, 2.6), (3, 0.0)])
def test_the_humanoid_balances_by_its_sensors_and_bears_pushes(
    processes: Processes, client: SimulatorClient, pushed: int, heading: float
) -> None:
    # Arrange: a push of 7 N s forward, one to the left and one backward, whichever way it looks
    imu = client.listen(topics.sensor_reading(SensorType.IMU, "imu/pelvis_imu"))
    rate, period = 1000, 4 if pushed > 1 else 1
    seconds = period * pushed + 6 if pushed > 1 else 6
    simulator = processes.simulator(
        "humanoid",
        rate=rate,
        max_ticks=rate * seconds,
        wait_for_subscribers=2,
        placement=[0.0, 0.0, 0.0, heading],
    )
    client.spin_until(client.wrenches.get_subscription_count, "a simulator that listens")
    for number in range(pushed):
        way = heading + number * math.pi / 2.0
        force = [70.0 * math.cos(way), 70.0 * math.sin(way), 0.0]
        stamp = TickClock(rate).stamp_ns(rate * period * (number + 1))
        client.wrenches.publish(wrench_message(stamp, [("chest", [*force, 0.0, 0.0, 0.0])]))

    # Act
    processes.python(example("balance"))
    last = client.spin_until(
        lambda: (
            client.states.messages
            and tick_of(client.states.last, rate) == rate * seconds + 1
            and client.states.last
        ),
        "the last state",
        2 * LONG,
    )
    assert simulator.wait() == 0

    # Assert
    names = list(last.name)
    heights = [state.position[names.index("root_z")] for state in client.states.messages]
    assert min(heights) > 0.86  # it begins at 0.882
    assert np.abs(last.velocity).max() < 0.2
    rates = [abs(message.angular_velocity.y) for message in imu.messages]
    assert max(rates) > 0.1  # the pushes were felt


def test_a_push_is_applied_when_and_as_it_was_sent_and_says_so(
    processes: Processes, client: SimulatorClient
) -> None:
    applied = client.listen(topics.APPLIED_WRENCH)
    simulator = processes.simulator(max_ticks=480, wait_for_subscribers=2)
    force, point, at = (20.0, 0.0, 5.0), (0.0, 0.0, -1.0), 1.0
    push = processes.python(
        example("push"),
        *("--link", "rod", "pivot", "--at", str(at)),
        *("--force", *map(str, force), "--point", *map(str, point)),
    )
    wait_until(lambda: "sent" in push.stdout, "a push that is sent")

    processes.python(example("pd_controller"))  # the world waits for its first answer

    client.state(481)
    assert simulator.wait() == 0
    assert push.wait() == 0
    assert "applied from 1.0000 s to 1.1000 s, 24 ticks" in push.stdout
    assert re.search(
        r"rod: force \[20\. +0\. +5\.\] N .* impulse \[2\. +0\. +0\.5\] N s", push.stdout
    )
    by_tick = {tick_of(message): message for message in applied.messages}
    acting = [tick for tick, message in by_tick.items() if message.joint_names]
    assert acting == list(range(241, 265))  # the ticks that begin at 1 s and later, for 0.1 s
    for tick in acting:
        message = by_tick[tick]
        assert list(message.joint_names) == ["rod", "pivot"]
        for wrench, transform in zip(message.wrench, message.transforms, strict=True):
            assert (wrench.force.x, wrench.force.y, wrench.force.z) == force
            where = transform.translation
            assert (where.x, where.y, where.z) == point
    states = [client.state(tick).position[0] for tick in range(1, 482)]
    assert states == pytest.approx(pushed_pendulum(force, set(acting), 481), abs=1e-6)
    assert min(states[240:]) < 0.95  # which was at 1 rad


def pushed_pendulum(force: tuple[float, float, float], acting: set[int], count: int) -> list[float]:
    """Angles of the pendulum under the example's PD, the rod's end pushed; semi-implicit Euler."""
    period, angle, speed = 1.0 / 240.0, 0.5, 0.0
    angles = [angle]
    for tick in range(2, count + 1):
        torque = 50.0 * (1.0 - angle) - 5.0 * speed  # what compensates gravity cancels with it
        if tick in acting:
            torque += -math.cos(angle) * force[0] + math.sin(angle) * force[2]
        speed += period * torque / (1.0 / 3.0)
        angle += period * speed
        angles.append(angle)
    return angles


def test_a_push_that_is_refused_is_told_to_have_had_no_effect(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(max_ticks=4800)
    push = processes.python(example("push"), "--link", "tail", "--force", "1", "0", "0")
    wait_until(lambda: "sent" in push.stdout, "a push that is sent")

    processes.python(example("pd_controller"))

    assert push.wait() == 1
    assert "nothing was applied" in push.stderr
    assert "'tail'" in simulator.stderr


def test_the_step_response_in_real_time_is_near_to_what_theory_says(
    processes: Processes, tmp_path: Path
) -> None:
    # slowly: what a busy machine is late by is a fifth as much of simulated time
    processes.simulator(
        "lift", mode="realtime", rate=500, real_time_factor=0.2, wait_for_subscribers=1
    )

    measurement = processes.python(example("step_response"), "--damping", "8", "--csv", "step.csv")

    assert measurement.wait(60.0) == 0
    rows = re.findall(r"^([\w-]+).*?([\d.]+) +([\d.]+)$", measurement.stdout, re.MULTILINE)
    measured, theory = ({row[0]: float(row[side]) for row in rows} for side in (1, 2))
    ratio = 8.0 / (2.0 * math.sqrt(100.0 * 1.0))
    overshoot = 100.0 * math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2))
    assert theory["overshoot"] == pytest.approx(overshoot, abs=0.1)
    assert measured["overshoot"] == pytest.approx(overshoot, abs=6.0)  # a late answer damps less
    assert measured["rise"] == pytest.approx(theory["rise"], abs=0.02)
    assert measured["steady-state"] == pytest.approx(1e3 * 9.81 / 100.0, abs=1.0)
    samples = np.loadtxt(tmp_path / "step.csv", delimiter=",", skiprows=1)
    assert len(samples) > 1000  # a busy machine loses some of the 1501
    assert samples[-1, 1] == pytest.approx(samples[-1, 2], abs=1e-3)
