"""What the sensors of a character read: IMUs by its states, force sensors by its contacts.

Readings are functions of the last two states, the contacts between them and the tick, so they do
not depend on whether a sensor was read before. The engine knows no accelerations: that of an IMU is
the difference between its velocities in the last two states, over the tick.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.sensors import Noise, Sensor, SensorType
from msgs_config.geometry import scalars
from msgs_config.messages.state import StampedState
from sim_node.node_settings import SensingSettings
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.sensors.link_motion import AT_REST, FrameMotion, LinkKinematics
from sim_node.sensors.noise import NoiseSource

_IMU_DOUBLES = 37  # sensor_msgs/Imu: orientation, rate, acceleration; a covariance after each
_ORIENTATION, _ANGULAR_VELOCITY, _ACCELERATION = slice(0, 4), slice(13, 16), slice(25, 28)
_COVARIANCES = {"orientation": 4, "angular_velocity": 16, "linear_acceleration": 28}
_DIAGONAL = 4  # entries of a covariance from one variance to the next
_NOT_MEASURED = -1.0  # first entry of a covariance: the quantity before it is not measured


class SensorReader:
    """Reads one sensor of a character. See `ImuReader` and `ForceReader`."""

    def __init__(
        self, character: SimulatedCharacter, sensor: Sensor, settings: SensingSettings
    ) -> None:
        """Find the sensor's link, and make the sources of its noise."""
        self._character, self._sensor, self._settings = character, sensor, settings
        self._kinematics = LinkKinematics(character.character, sensor.link)
        self._axes = scalars.axes(sensor.orientation_xyzw)  # the sensor's axes in the link frame
        name = f"{character.setup.prefix}{sensor.name}"
        self._noise = {
            quantity: NoiseSource(noise, settings.seed, f"{name}.{quantity}", settings.tick_s)
            for quantity, noise in self._noise_in_force().items()
        }

    def read(self, tick: int) -> FloatArray | None:
        """All doubles of the sensor's message at a tick; None if it has nothing to say."""
        raise NotImplementedError

    def _noise_in_force(self) -> dict[str, Noise]:
        """The noise of each quantity: the sensor's own, white noise as the settings have it."""
        noise = dict(self._sensor.noise)
        for quantity, deviation in self._settings.deviations().items():
            if quantity in self._sensor.type.quantities:
                white = (deviation,) * 3
                noise[quantity] = replace(noise.get(quantity, Noise()), stddev=white)
        return noise

    def _with_noise(self, quantity: str, value: scalars.Vector, tick: int) -> scalars.Vector:
        if quantity not in self._noise:
            return value
        (x, y, z), (dx, dy, dz) = value, self._noise[quantity].at(tick)
        return (x + dx, y + dy, z + dz)


class ImuReader(SensorReader):
    """Orientation, angular velocity and specific force of a frame, for `sensor_msgs/Imu`.

    The specific force of a state at t is `R^-1 ((v(t) - v(t - h)) / h - g)` with the frame's
    orientation R at t, the velocity v of its origin in the world, and a tick's length h: the mean
    over the tick before, so that `v` is the sum of what is measured. At rest it is `g` upwards. In
    an episode's first state there is none: zeros, and -1 for the covariance's first entry.

    Source: REP 145, "Conventions for IMU Sensor Drivers".
    """

    def __init__(
        self, character: SimulatedCharacter, sensor: Sensor, settings: SensingSettings
    ) -> None:
        """Fill in the covariances: the variances of the white noise, or zeros for unknown."""
        super().__init__(character, sensor, settings)
        self._doubles = np.zeros(_IMU_DOUBLES)
        for quantity, start in _COVARIANCES.items():
            deviations = np.array(self._noise_in_force().get(quantity, Noise()).stddev)
            self._doubles[start : start + 9 : _DIAGONAL] = deviations * deviations
        self._last: tuple[StampedState | None, FrameMotion] = (None, AT_REST)
        self._first_variance = self._doubles[_COVARIANCES["linear_acceleration"]]

    def read(self, tick: int) -> FloatArray:
        """The doubles (37,) of the message."""
        state, before = self._character.state, self._character.before
        motion = self._motion(state)
        turn, force, variance = motion.turn_xyzw, (0.0, 0.0, 0.0), _NOT_MEASURED
        if before is not None:
            (vx, vy, vz), (ux, uy, uz) = motion.velocity, self._motion(before).velocity
            h, gravity = self._settings.tick_s, self._settings.gravity
            in_world = ((vx - ux) / h, (vy - uy) / h, (vz - uz) / h + gravity)
            force = scalars.to_child(scalars.axes(turn), in_world)
            force = self._with_noise("linear_acceleration", force, tick)
            variance = self._first_variance
        if "orientation" in self._noise:
            turn = scalars.multiply(turn, scalars.exp(self._noise["orientation"].at(tick)))
        self._last = (state, motion)
        doubles = self._doubles
        doubles[_ORIENTATION] = turn
        doubles[_ANGULAR_VELOCITY] = self._with_noise(
            "angular_velocity", motion.angular_velocity, tick
        )
        doubles[_ACCELERATION] = force
        doubles[_COVARIANCES["linear_acceleration"]] = variance
        return doubles

    def _motion(self, state: StampedState) -> FrameMotion:
        """The motion of the sensor's frame in a state."""
        read_state, motion = self._last
        if read_state is not state:  # the state before was mostly read a tick ago
            link = self._kinematics.motion(state.position.tolist(), state.velocity.tolist())
            motion = link.at(self._sensor.position, self._sensor.orientation_xyzw)
        return motion


class ForceReader(SensorReader):
    """Force and torque of all contacts on a link, in the sensor's frame and about its origin.

    It is what the surroundings do to the link: a foot that stands is pressed upwards. The mean over
    the tick before, turned into the frame by the link's orientation in the present state.
    """

    def __init__(
        self, character: SimulatedCharacter, sensor: Sensor, settings: SensingSettings
    ) -> None:
        """Find the link's centre of mass, about which contacts are known."""
        super().__init__(character, sensor, settings)
        links = character.character.links
        self._link = [link.name for link in links].index(sensor.link)
        (x, y, z), (cx, cy, cz) = sensor.position, links[self._link].inertial_pose.position
        self._arm = (cx - x, cy - y, cz - z)  # from the sensor to the centre, link frame

    def read(self, tick: int) -> FloatArray | None:
        """Force and torque (6,), N and N m; None if contacts were not watched in the tick."""
        contacts, state = self._character.contacts, self._character.state
        if contacts is None:
            return None
        force = torque = (0.0, 0.0, 0.0)
        if contacts.touching[self._link]:
            fx, fy, fz, *moment = contacts.wrenches[self._link].tolist()
            link = scalars.axes(self._kinematics.orientation(state.position.tolist()))
            force_in_link = scalars.to_child(link, (fx, fy, fz))
            x, y, z = scalars.to_child(link, moment)
            ax, ay, az = scalars.cross(self._arm, force_in_link)
            force = scalars.to_child(self._axes, force_in_link)
            torque = scalars.to_child(self._axes, (x + ax, y + ay, z + az))
        force = self._with_noise("force", force, tick)
        return np.array((*force, *self._with_noise("torque", torque, tick)))


_READERS: dict[SensorType, type[SensorReader]] = {
    SensorType.IMU: ImuReader,
    SensorType.FORCE: ForceReader,
}


def make_readers(
    character: SimulatedCharacter, settings: SensingSettings
) -> Sequence[tuple[Sensor, SensorReader]]:
    """The sensors of a character, each with what reads it."""
    return [
        (sensor, _READERS[sensor.type](character, sensor, settings))
        for sensor in character.character.sensors
    ]
