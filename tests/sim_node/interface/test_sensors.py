"""The sensors on their topics: what is read, for which state, and only for subscribers."""

from pathlib import Path

import numpy as np
import pytest
from rclpy.context import Context

from msgs_config.bus.dds import DdsNode
from msgs_config.character.sensors import SensorType
from msgs_config.messages import topics
from msgs_config.messages.cdr import read_frame_id
from sim_node import parameters as for_simulator
from sim_node.interface.sensors import SensorPublishers
from sim_node.node_settings import NodeSettings, SensingSettings
from sim_node.sensors.readers import SensorReader, make_readers
from tests.sim_node.conftest import Join
from tests.support.physics import LoneSimulation, simulation
from tests.support.ros import (
    Processes,
    ReceivedMessages,
    SimulatorClient,
    stamp_ns,
    tick_of,
)

SETTINGS = SensingSettings(240, 9.81, 0)
IMU, SOLE = (
    topics.sensor_reading(*each)
    for each in ((SensorType.IMU, "imu/pelvis_imu"), (SensorType.FORCE, "force/left_sole"))
)
NOISY = """
urdf: package://pybullet_data/humanoid/humanoid.urdf
scale: 0.25
up_axis: y
inertia: shapes
rest_pose: {root_z: 0.9}
sensors:
  imu:
    noisy:
      link: left_ankle
      xyz: [0.1, 0, 0]
      noise:
        orientation: {stddev: 0.01}
        angular_velocity: {stddev: [0.1, 0.2, 0.3], bias_walk: 0.1}
        linear_acceleration: {bias: [1, 2, 3], bias_stddev: 0.5}
  force:
    scale: {link: left_ankle, noise: {force: {stddev: 1}}}
"""
NOISY_TOPICS = [
    topics.sensor_reading(*each)
    for each in ((SensorType.IMU, "imu/noisy"), (SensorType.FORCE, "force/scale"))
]


@pytest.fixture
def noisy(tmp_path: Path) -> str:
    """A character's file whose sensors are noisy."""
    path = tmp_path / "noisy.yaml"
    path.write_text(NOISY, encoding="utf-8")
    return str(path)


def test_readings_belong_to_the_states_and_come_before_them(
    processes: Processes, client: SimulatorClient
) -> None:
    inboxes = {name: client.listen(topic) for name, topic in (("imu", IMU), ("sole", SOLE))}
    processes.simulator("humanoid", wait_for_subscribers=1, republish_period=60.0)

    client.drive(client.first_state(), 40, np.random.default_rng(3))
    for inbox in inboxes.values():
        client.spin_until(lambda inbox=inbox: 41 in inbox.ticks(), "readings")

    imu, sole = (inbox.by_tick() for inbox in inboxes.values())
    states = dict(zip(client.states.ticks(), client.states.sent_ns, strict=True))
    for inbox in inboxes.values():
        sent = dict(zip(inbox.ticks(), inbox.sent_ns, strict=True))
        assert all(sent[tick] <= states[tick] for tick in sent)
    assert set(imu) >= set(range(10, 42))
    rng, loads = np.random.default_rng(3), []
    with simulation("humanoid") as run:
        run.watches_contacts = True
        readers = {sensor.name: each for sensor, each in make_readers(run.simulated, SETTINGS)}
        for tick in range(1, 42):
            if tick > 1:
                effort = np.zeros(run.layout.size)
                effort[6:] = rng.uniform(-20.0, 20.0, run.layout.size - 6)
                run.advance(effort)
            expected = readers["pelvis_imu"].read(tick)
            if tick in imu:
                assert _doubles_of_imu(imu[tick]) == expected.tolist()  # to the bit
                assert imu[tick].header.frame_id == "pelvis_imu"
            load = readers["left_sole"].read(tick)
            if tick in sole and tick > 10:
                assert _doubles_of_wrench(sole[tick]) == load.tolist()
                assert sole[tick].header.frame_id == "left_sole"
                loads.append(load[2])
    assert max(loads) > 50.0  # it did stand


def _doubles_of_imu(message: object) -> list[float]:
    parts = []
    for quantity in ("orientation", "angular_velocity", "linear_acceleration"):
        value = getattr(message, quantity)
        parts += [getattr(value, axis) for axis in ("xyzw" if quantity == "orientation" else "xyz")]
        parts += getattr(message, f"{quantity}_covariance").tolist()
    return parts


def _doubles_of_wrench(message: object) -> list[float]:
    wrench = message.wrench
    return [getattr(part, axis) for part in (wrench.force, wrench.torque) for axis in "xyz"]


def run_noisy(
    processes: Processes, client: SimulatorClient, file: str, listens_from: int = 1, **given: object
) -> list[dict[int, bytes]]:
    """The bytes of the readings, by tick, of a character that falls."""
    received: list[ReceivedMessages] = []
    if listens_from == 1:
        received = [client.listen(topic) for topic in NOISY_TOPICS]
    client.states.messages.clear()
    simulator = processes.simulator(file, wait_for_subscribers=1, **given)
    state = client.first_state()
    while tick_of(state) < 120:
        if tick_of(state) == listens_from:
            received = [client.listen(topic) for topic in NOISY_TOPICS]
        state = client.advance(state, {})
    for inbox in received:
        client.spin_until(lambda inbox=inbox: 120 in inbox.ticks(), "the last reading")
    simulator.end()
    return [dict(zip(inbox.ticks(), inbox.raw, strict=True)) for inbox in received]


def test_the_same_run_has_the_same_bytes_whenever_listening_begins(
    processes: Processes, context: Context, client: SimulatorClient, noisy: str
) -> None:
    first = run_noisy(processes, client, noisy)
    later = SimulatorClient(context, "later")
    try:
        second = run_noisy(processes, later, noisy, listens_from=50, sensor_seed=0)
    finally:
        later.close()
    other = SimulatorClient(context, "other")
    try:
        third = run_noisy(processes, other, noisy, sensor_seed=1)
    finally:
        other.close()

    for all_ticks, from_middle, with_seed in zip(first, second, third, strict=True):
        common = [tick for tick in from_middle if tick > 60 and tick in all_ticks]
        assert len(common) > 40
        assert [from_middle[tick] for tick in common] == [all_ticks[tick] for tick in common]
        assert all(with_seed[tick] != all_ticks[tick] for tick in range(60, 120))


def test_a_late_subscriber_gets_the_readings_of_the_waiting_state(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", wait_for_subscribers=1, republish_period=0.05)
    state = client.drive(client.first_state(), 5, np.random.default_rng(1))

    imu, sole = client.listen(IMU), client.listen(SOLE)
    client.spin_until(lambda: imu.messages and sole.messages, "readings")

    assert stamp_ns(imu.last) == stamp_ns(sole.last) == stamp_ns(state)
    assert imu.last.linear_acceleration_covariance[0] == 0.0  # of the tick that led to the state
    assert not any(_doubles_of_wrench(sole.last))  # contacts were not watched in that tick


def test_nothing_is_read_while_there_are_no_subscribers(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(self: SensorReader, tick: int) -> None:
        raise AssertionError("it was read")

    run: LoneSimulation = simulation("humanoid")
    for _, reader in make_readers(run.simulated, SETTINGS):
        monkeypatch.setattr(type(reader), "read", fail)
    settings = NodeSettings.of(for_simulator.load_parameters({}).values)
    node = DdsNode("test_sensors", context=context)
    try:
        publishers = SensorPublishers(node, run.simulated, settings)
        assert not publishers.wants_contacts
        assert list(publishers.messages()) == []
        assert {each.topic_name for each in publishers.publishers} == {
            *("/imu/pelvis_imu", "/force/left_sole", "/force/right_sole")
        }
    finally:
        node.destroy_node()


def test_sensors_of_several_characters_are_below_their_names(
    processes: Processes, join: Join, noisy: str
) -> None:
    left, right = join("at_left", "left"), join("at_right", "right")
    inboxes = [each.listen(IMU.under(below)) for each, below in ((left, "left"), (right, "right"))]
    processes.simulator(
        "humanoid",
        characters=["left", "right"],
        **{"right.placement": [2.0, 0.0, 0.0, 0.5]},
    )

    frames = []
    for client, inbox in zip((left, right), inboxes, strict=True):
        client.spin_until(lambda inbox=inbox: inbox.messages, "a reading")
        frames.append(read_frame_id(inbox.raw[0]))

    assert frames == ["left/pelvis_imu", "right/pelvis_imu"]
    turn = inboxes[1].last.orientation
    assert (turn.z, turn.w) == pytest.approx((np.sin(0.25), np.cos(0.25)))
