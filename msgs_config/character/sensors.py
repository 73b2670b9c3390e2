"""The sensors of a character as its YAML file names them: what, where, and how noisy."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from msgs_config.errors import CharacterError, one_of
from msgs_config.geometry import scalars
from msgs_config.geometry.rotations import IDENTITY_XYZW
from msgs_config.mappings import MappingReader

_ZERO: scalars.Vector = (0.0, 0.0, 0.0)
_WORLD = "world"  # a frame that is there for every character
_MAX_OFFSET = 1e3  # m from the link's origin
_LARGEST_ANGLE = 2.0 * math.pi  # rad; degrees are mostly more
LARGEST_NOISE = 1e9  # its square is a number as well, in any unit
_MOST_LETTERS = 64
_SENSOR_KEYS = ("link", "xyz", "rpy", "noise")
_NOISE_KEYS = ("stddev", "bias", "bias_stddev", "bias_walk")


class SensorType(Enum):
    """Kind of a sensor: its key in the file, and what its topics are below."""

    IMU = "imu"
    FORCE = "force"

    @property
    def quantities(self) -> tuple[str, ...]:
        """The vectors that it measures; each may have noise."""
        return _QUANTITIES[self]


_QUANTITIES = {
    SensorType.IMU: ("orientation", "angular_velocity", "linear_acceleration"),
    SensorType.FORCE: ("force", "torque"),
}


@dataclass(frozen=True)
class Noise:
    """What is added to a measured vector, per axis of the sensor, in the vector's unit."""

    stddev: scalars.Vector = _ZERO  # white noise's, drawn at each tick
    bias: scalars.Vector = _ZERO  # constant
    bias_stddev: scalars.Vector = _ZERO  # a constant bias', drawn once from the seed
    bias_walk: scalars.Vector = _ZERO  # a walking bias', after 1 s; it grows with time's root

    def __bool__(self) -> bool:
        return self != Noise()


@dataclass(frozen=True)
class Sensor:
    """A sensor on a link; its frame has its name, and a pose in the link frame."""

    name: str
    type: SensorType
    link: str
    position: scalars.Vector = _ZERO  # m
    orientation_xyzw: scalars.Quaternion = IDENTITY_XYZW
    noise: dict[str, Noise] = field(default_factory=dict)
    """By the measured quantity; those without noise are left out."""

    @property
    def topic(self) -> str:
        """Name of the topic of its readings, below the character's."""
        return f"{self.type.value}/{self.name}"


def read_sensors(reader: MappingReader) -> tuple[Sensor, ...]:
    """The sensors in the mapping under the key `sensors` of a character's file.

    Raises:
        ActuatedCharactersError: names the key and what would be right.
    """
    reader.check_keys([each.value for each in SensorType])
    return tuple(sensor for each in SensorType for sensor in _read_type(reader, each))


def check_sensors(path: Path, sensors: Sequence[Sensor], links: Mapping[str, bool]) -> None:
    """Check links and names of sensors; `links` says of each whether it has collision shapes.

    Raises:
        CharacterError: names the sensor and what would be right.
    """
    taken = {*links, _WORLD}
    for sensor in sensors:
        key = f"{path}: sensors.{sensor.type.value}.{sensor.name}"
        if sensor.link not in links:
            raise CharacterError(f"{key}.link: {one_of('link', sensor.link, list(links))}")
        if sensor.type is SensorType.FORCE and not links[sensor.link]:
            touchable = ", ".join(name for name, has_shapes in links.items() if has_shapes)
            raise CharacterError(
                f"{key}.link is '{sensor.link}', which has no collision shape; it must be a link "
                f"that can be touched: {touchable or 'there is none'}"
            )
        if sensor.name in taken:
            raise CharacterError(
                f"{key}: a frame has the name '{sensor.name}' already; the sensor's must differ "
                "from those of all links and other sensors"
            )
        taken.add(sensor.name)


def _read_type(reader: MappingReader, sensor_type: SensorType) -> Iterator[Sensor]:
    for name, each in reader.parts(sensor_type.value, _SENSOR_KEYS).items():
        if not (name.isascii() and name.isidentifier() and len(name) <= _MOST_LETTERS):
            part = reader.part(sensor_type.value)
            right = f"named by at most {_MOST_LETTERS} letters, digits and underscores"
            raise part.wrong(name, name, f"{right}, as its topic and frame have the name")
        noise = each.part("noise")
        noise.check_keys(sensor_type.quantities)
        read = {key: _read_noise(noise.part(key)) for key in noise.content}
        yield Sensor(
            name,
            sensor_type,
            each.text("link"),
            _vector(each.numbers("xyz", 3, (-_MAX_OFFSET, _MAX_OFFSET), [0.0] * 3)),
            scalars.of_roll_pitch_yaw(
                each.numbers("rpy", 3, (-_LARGEST_ANGLE, _LARGEST_ANGLE), [0.0] * 3)
            ),
            {key: value for key, value in read.items() if value},
        )


def _read_noise(reader: MappingReader) -> Noise:
    reader.check_keys(_NOISE_KEYS)
    return Noise(**{key: _per_axis(reader, key) for key in reader.content})


def _per_axis(reader: MappingReader, key: str) -> scalars.Vector:
    """A number for each axis: a list of three, or one for all; a deviation is not negative."""
    bounds = (-LARGEST_NOISE if key == "bias" else 0.0, LARGEST_NOISE)
    if isinstance(reader.content[key], list):
        return _vector(reader.numbers(key, 3, bounds))
    return (reader.number(key, minimum=bounds[0], maximum=bounds[1]),) * 3


def _vector(numbers: tuple[float, ...]) -> scalars.Vector:
    x, y, z = numbers
    return (x, y, z)
