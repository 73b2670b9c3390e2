"""What sensors read, against what mechanics says of bodies whose motion is known."""

import math
from pathlib import Path

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.character.sensors import Noise, Sensor, SensorType
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations
from sim_node import parameters as for_simulator
from sim_node.node_settings import SensingSettings
from sim_node.parameters import load_parameters
from sim_node.sensors.link_motion import LinkKinematics
from sim_node.sensors.readers import ForceReader, ImuReader, SensorReader
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.physics import (
    FLOATING_TURNED_FRAMES,
    LoneSimulation,
    box_character,
    character,
    controller,
    momentum,
    run_together,
    simulation,
)

pytestmark = pytest.mark.usefixtures("engine")

COVARIANCES = slice(4, 13), slice(16, 25), slice(28, 37)
G = 9.81
RATE = 240
SETTINGS = SensingSettings(RATE, G, seed=0)
POSE = ((0.1, -0.2, 0.3), tuple(rotations.exp(np.array((0.3, -1.0, 0.7))).tolist()))


def imu(link: str, pose: tuple[object, ...] = (), **noise: Noise) -> Sensor:
    return Sensor("imu", SensorType.IMU, link, *pose, noise=noise)  # type: ignore[arg-type]


def force_sensor(link: str, pose: tuple[object, ...] = (), **noise: Noise) -> Sensor:
    return Sensor("force", SensorType.FORCE, link, *pose, noise=noise)  # type: ignore[arg-type]


def reader(
    run: LoneSimulation, sensor: Sensor, settings: SensingSettings = SETTINGS
) -> SensorReader:
    kind = ImuReader if sensor.type is SensorType.IMU else ForceReader
    return kind(run.simulated, sensor, settings)


def read(run: LoneSimulation, sensor: SensorReader) -> FloatArray:
    values = sensor.read(run.tick)
    assert values is not None
    return values.copy()


def read_at(sensor: SensorReader, tick: int) -> FloatArray:
    values = sensor.read(tick)
    assert values is not None
    return values.copy()


def orientation(values: FloatArray) -> FloatArray:
    return values[0:4]


def rate(values: FloatArray) -> FloatArray:
    return values[13:16]


def force(values: FloatArray) -> FloatArray:
    return values[25:28]


def of_character(whole: Character, **given: object) -> LoneSimulation:
    """A simulation of a character that is no shipped one."""
    values = for_simulator.resolve_alone(whole, given)
    return LoneSimulation(make_character_setup(whole, values), make_simulation_settings(values))


# IMU


def test_a_body_that_falls_and_turns_freely_feels_nothing_at_its_centre(tmp_path: Path) -> None:
    spin = [0.3, -1.0, 2.0]
    run = of_character(
        box_character(tmp_path, "0.2 0.3 0.4"),  # with equal moments of inertia
        initial_position=[0.0, 0.0, 9.0, 0.4, 0.2, -0.1],
        initial_velocity=[1.0, 2.0, 3.0, *spin],
    )
    at_centre = reader(run, imu("box"))
    assert read(run, at_centre)[28] == -1.0  # no acceleration before the first tick

    for _ in range(20):
        run.advance(np.zeros(6))
        values = read(run, at_centre)
        assert force(values) == pytest.approx(np.zeros(3), abs=1e-9)
        assert rate(values) == pytest.approx(spin, abs=1e-9)
        assert values[28] == 0.0


def test_a_spinning_body_feels_the_centripetal_acceleration_off_its_centre(tmp_path: Path) -> None:
    arm, spin, rate_hz = np.array((0.1, -0.2, 0.3)), np.array((0.3, -1.0, 2.0)), 100_000
    run = of_character(
        box_character(tmp_path, "0.2 0.3 0.4"),
        rate=rate_hz,
        initial_position=[0.0, 0.0, 9.0, 0.0, 0.0, 0.0],
        initial_velocity=[0.0, 0.0, 0.0, *spin.tolist()],
    )
    off_centre = reader(run, imu("box", POSE), SensingSettings(rate_hz, G, 0))

    run.advance(np.zeros(6))
    values = read(run, off_centre)

    back = rotations.conjugate(np.array(POSE[1]))
    expected = np.cross(spin, np.cross(spin, arm))
    # the difference over a tick is of first order in its length
    assert force(values) == pytest.approx(rotations.rotate(back, expected), abs=1e-4)
    assert rate(values) == pytest.approx(rotations.rotate(back, spin), abs=1e-9)


def test_what_is_measured_adds_up_to_the_velocity_of_the_sensor() -> None:
    run = simulation(FLOATING_TURNED_FRAMES, terrain="none", initial_velocity=_random_velocity())
    link = run.simulated.character.links[-1].name
    sensor = reader(run, imu(link, POSE))
    assert isinstance(sensor, ImuReader)
    motion = sensor._motion(run.state)
    velocity = np.array(motion.velocity)

    for _ in range(30):
        run.advance(np.full(run.layout.size, 0.1))
        values = read(run, sensor)
        in_world = rotations.rotate(orientation(values), force(values))
        velocity += (in_world - np.array((0.0, 0.0, G))) / RATE

    assert velocity == pytest.approx(sensor._motion(run.state).velocity, abs=1e-9)


def _random_velocity() -> list[float]:
    size = character(FLOATING_TURNED_FRAMES).layout.size
    return np.random.default_rng(1).uniform(-1.0, 1.0, size).tolist()


def test_a_standing_body_feels_gravity_upwards(tmp_path: Path, engine: str) -> None:
    steadiness = {"bullet": 1e-4, "mujoco": 2e-4}[engine]  # rad/s
    run = of_character(
        box_character(tmp_path, "0.2 0.3 0.4"), initial_position=[0.0, 0.0, 0.2, 0.0, 0.0, 0.7]
    )
    run.watches_contacts = True
    sensors = reader(run, imu("box", POSE)), reader(run, force_sensor("box", POSE))
    last: list[tuple[FloatArray, ...]] = []
    for tick in range(480):
        run.advance(np.zeros(6))
        if tick >= 432:
            last.append(tuple(read(run, sensor) for sensor in sensors))

    # On Bullet its corners bear it in turn, so that it trembles by 0.05 m/s^2.
    felt, wrench = (np.mean(readings, axis=0) for readings in zip(*last, strict=True))
    assert max(np.abs(force(each) - force(felt)).max() for each, _ in last) < 0.1

    up = rotations.rotate(rotations.conjugate(orientation(felt)), np.array((0.0, 0.0, 1.0)))
    assert force(felt) == pytest.approx(G * up, abs=1e-2)
    assert rate(felt) == pytest.approx(np.zeros(3), abs=steadiness)
    yaw = rotations.exp(np.array((0.0, 0.0, 0.7)))
    expected = rotations.multiply(yaw, np.array(POSE[1]))
    assert abs(float(orientation(felt) @ expected)) == pytest.approx(1.0, abs=1e-6)
    # 2 kg press on the ground below the centre, which is at minus the pose's position
    assert wrench[:3] == pytest.approx(2.0 * G * up, abs=1e-3)
    to_centre = rotations.rotate(rotations.conjugate(np.array(POSE[1])), -np.array(POSE[0]))
    assert wrench[3:] == pytest.approx(np.cross(to_centre, wrench[:3]), abs=1e-3)


def test_a_pendulum_feels_the_closed_form() -> None:
    length, angle, speed, rate_hz = 1.0, 0.8, 1.5, 100_000
    run = simulation("pendulum", rate=rate_hz, initial_position=[angle], initial_velocity=[speed])
    rod = run.simulated.character.links[-1].name
    pose = ((0.0, 0.0, -length), (0.0, 0.0, 0.0, 1.0))
    sensor = reader(run, imu(rod, pose), SensingSettings(rate_hz, G, 0))

    run.advance(np.zeros(1))
    values = read(run, sensor)

    # of a rod of mass m that hangs by its end: (m l^2 / 3) alpha = -m g (l / 2) sin(angle)
    alpha = -1.5 * G / length * math.sin(angle)
    along = length * speed**2 + G * math.cos(angle)  # towards the hinge
    across = length * alpha + G * math.sin(angle)  # the way in which the angle grows, -x
    assert force(values) == pytest.approx([-across, 0.0, along], abs=2e-3)
    assert rate(values) == pytest.approx([0.0, speed, 0.0], abs=1e-3)


# Force sensors


def in_world(run: LoneSimulation, sensor: Sensor, vector: FloatArray) -> FloatArray:
    """A vector of a sensor's frame in the present state."""
    link_motion = LinkKinematics(run.simulated.character, sensor.link)
    turn = np.array(link_motion.orientation(run.state.position.tolist()))
    return rotations.rotate(rotations.multiply(turn, np.array(sensor.orientation_xyzw)), vector)


@pytest.mark.parametrize("substeps", [1, 4])
def test_contacts_change_the_momentum_of_a_box_that_tumbles(tmp_path: Path, substeps: int) -> None:
    # Arrange: it is thrown to the ground, and slides, rolls and tips there
    run = of_character(
        box_character(tmp_path, "0.2 0.3 0.4"),
        substeps=substeps,
        initial_position=[0.0, 0.0, 0.5, 0.3, 0.2, 0.1],
        initial_velocity=[3.0, 1.0, -2.0, 4.0, 3.0, -2.0],
    )
    run.watches_contacts = True
    sensor = force_sensor("box", POSE)
    each, velocity, hardest = reader(run, sensor), run.state.velocity[:3], 0.0

    for _ in range(300):
        # Act
        run.advance(np.zeros(6))
        felt = in_world(run, sensor, read(run, each)[:3])

        # Assert: m (a - g), tick by tick
        expected = 2.0 * (RATE * (run.state.velocity[:3] - velocity) + np.array((0.0, 0.0, G)))
        assert felt == pytest.approx(expected, abs=1e-6)
        velocity, hardest = run.state.velocity[:3], max(hardest, expected[2])

    assert hardest > 20.0 * 2.0 * G


@pytest.mark.slow
def test_the_soles_of_a_standing_humanoid_bear_its_weight() -> None:
    run = simulation("humanoid")
    run.watches_contacts = True
    whole = run.simulated.character
    driver = controller(
        "humanoid", reference="hold", root_assistance=False, **{"balance.enabled": True}
    )
    soles = [each for each in whole.sensors if each.type is SensorType.FORCE]
    readers = [reader(run, each) for each in soles]
    loads, before = [], momentum(run.simulated._body, whole)[0]

    for _ in run_together(run, driver, 2 * RATE):
        after = momentum(run.simulated._body, whole)[0]
        if run.tick > RATE:
            felt = [read(run, each)[:3] for each in readers]
            loads.append([force[2] for force in felt])
            total = np.sum([in_world(run, *each) for each in zip(soles, felt, strict=True)], axis=0)
            expected = RATE * (after - before) + whole.mass * np.array((0.0, 0.0, G))
            assert total == pytest.approx(expected, abs=1e-3 * whole.mass * G)
        before = after

    # the sensors' z points up, and both feet bear about a half
    assert np.sum(np.mean(loads, axis=0)) == pytest.approx(whole.mass * G, rel=0.01)
    assert np.mean(loads, axis=0) == pytest.approx(0.5 * whole.mass * G, rel=0.1)


def test_a_force_beside_the_sensor_has_a_moment_about_it(tmp_path: Path) -> None:
    run = of_character(
        box_character(tmp_path, "0.2 0.3 0.4"), initial_position=[0.0, 0.0, 0.2, 0.0, 0.0, 0.0]
    )
    run.watches_contacts = True
    beside = reader(run, force_sensor("box", ((0.0, -0.5, 0.0), (0.0, 0.0, 0.0, 1.0))))
    for _ in range(240):
        run.advance(np.zeros(6))

    wrench = read(run, beside)

    # 2 kg act half a metre to the left (y) of the sensor: a moment of r x f = 0.5 f about x
    assert wrench == pytest.approx([0.0, 0.0, 2 * G, 0.5 * 2 * G, 0.0, 0.0], abs=1e-3)


def test_contacts_that_were_not_watched_are_no_reading() -> None:
    run = simulation("humanoid")
    sole = reader(run, force_sensor("left_ankle"))
    assert read(run, sole).tolist() == [0.0] * 6  # nothing acted before the first state

    run.advance(np.zeros(run.layout.size))

    assert sole.read(run.tick) is None


# Noise


def test_noise_is_added_to_each_quantity_and_its_variance_is_the_covariance() -> None:
    run = simulation("humanoid")
    run.watches_contacts = True
    run.advance(np.zeros(run.layout.size))
    noises = {
        "orientation": Noise(stddev=(0.01, 0.0, 0.0)),
        "angular_velocity": Noise(stddev=(0.1, 0.2, 0.3), bias=(5.0, 0.0, 0.0)),
        "linear_acceleration": Noise(bias=(0.0, 7.0, 0.0)),
    }
    clean, noisy = (reader(run, imu("chest", POSE, **noise)) for noise in ({}, noises))

    differences = []
    for tick in range(1, 4001):
        a, b = clean.read(tick), noisy.read(tick)
        assert a is not None and b is not None
        turn = rotations.multiply(rotations.conjugate(orientation(a)), orientation(b))
        differences.append([*rotations.log(turn), *(rate(b) - rate(a)), *(force(b) - force(a))])

    spread, mean = np.std(differences, axis=0), np.mean(differences, axis=0)
    assert spread == pytest.approx([0.01, 0, 0, 0.1, 0.2, 0.3, 0, 0, 0], rel=0.05, abs=1e-9)
    assert mean == pytest.approx([0, 0, 0, 5, 0, 0, 0, 7, 0], abs=0.02)
    values = read(run, noisy)
    assert values[4:13].reshape(3, 3) == pytest.approx(np.diag((1e-4, 0.0, 0.0)))
    assert values[16:25].reshape(3, 3) == pytest.approx(np.diag((0.01, 0.04, 0.09)))
    assert not values[28:].any()  # a bias has no stated variance: unknown
    assert not np.concatenate([read(run, clean)[part] for part in COVARIANCES]).any()

    wrenches = force_sensor("left_ankle", torque=Noise(bias=(1.0, 2.0, 3.0)))
    assert read(run, reader(run, wrenches))[3:] == pytest.approx([1.0, 2.0, 3.0])


def test_settings_have_white_noise_in_place_of_the_sensors_own() -> None:
    run = simulation("humanoid")
    own = Noise(stddev=(0.1, 0.2, 0.3), bias=(5.0, 0.0, 0.0))
    settings = SensingSettings(RATE, G, 0, ("angular_velocity:0.5", "force:2"))
    sensor = imu("chest", POSE, angular_velocity=own, orientation=Noise(stddev=(0.01,) * 3))
    noisy = reader(run, sensor, settings)

    rates = [rate(read_at(noisy, tick)) for tick in range(1, 2001)]

    assert np.std(rates, axis=0) == pytest.approx([0.5] * 3, rel=0.07)
    assert np.mean(rates, axis=0) == pytest.approx([5.0, 0.0, 0.0], abs=0.05)
    values = read(run, noisy)
    assert values[16:25].reshape(3, 3) == pytest.approx(0.25 * np.eye(3))
    assert values[4:13].reshape(3, 3) == pytest.approx(1e-4 * np.eye(3))

    sole = reader(run, force_sensor("left_ankle", force=Noise(bias=(0.0, 0.0, 1e4))), settings)
    run.watches_contacts = True
    run.advance(np.zeros(run.layout.size))
    readings = [read_at(sole, tick) for tick in range(1, 2001)]
    assert np.std(readings, axis=0) == pytest.approx([2.0] * 3 + [0.0] * 3, rel=0.07, abs=1e-9)
    assert np.mean(readings, axis=0)[2] > 9e3


@pytest.mark.parametrize(
    ("noise", "sentence"),
    [
        ("speed:1", "'sensor_noise' has 'speed:1': unknown quantity 'speed'; there are: orient"),
        ("force:-1", "'sensor_noise' has 'force:-1'; it must be QUANTITY:NUMBER, the number 0 to"),
        ("force", "'sensor_noise' has 'force'; it must be QUANTITY:NUMBER"),
        ("force:1,force:2", "'sensor_noise' has 'force' twice; give it once"),
    ],
)
def test_noise_of_what_no_sensor_measures_is_one_line(noise: str, sentence: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_parameters({"sensor_noise": noise.split(",")})

    assert sentence in str(caught.value)


def test_readings_go_on_after_a_snapshot_as_they_would_have() -> None:
    run, other = (simulation("humanoid") for _ in range(2))
    sensor = imu("chest", POSE, angular_velocity=Noise(stddev=(1.0,) * 3))
    for simulated in (run, other):
        simulated.watches_contacts = True
    efforts = np.random.default_rng(2).uniform(-3.0, 3.0, (8, run.layout.size))
    for effort in efforts:
        run.advance(effort)
    snapshot = run.snapshot()

    other.advance(np.zeros(other.layout.size))
    other.load_snapshot(snapshot)

    assert (read(run, reader(run, sensor)) == read(other, reader(other, sensor))).all()
