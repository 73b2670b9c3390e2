"""The parameters of the reference `steered`, and what they make."""

import numpy as np

from controller_node.references.base import REFERENCES, Motion
from controller_node.references.clip import ClipReference
from controller_node.references.steering.gait import Gait, cycle_of, standing_cycle
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import SteeringLimits
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.clips.reading import expand_clips, read_clip
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Parameter, Values
from msgs_config.shared_parameters import RATE

PARAMETERS = (
    Parameter("steering.walk", "walk", "the clip that a steered character walks by"),
    Parameter("steering.run", "run", "the clip that it runs by"),
    Parameter(
        "steering.clips",
        [],
        "cycles to move by instead of these two: names, files, or folders of them",
        texts=True,
    ),
    Parameter("steering.speed", 2.5, "its largest speed ahead", unit="m/s", maximum=10.0),
    Parameter(
        "steering.acceleration", 1.3, "of its speed", unit="m/s^2", minimum=0.01, maximum=100.0
    ),
    Parameter(
        "steering.braking",
        2.2,
        "likewise, while it slows down",
        unit="m/s^2",
        minimum=0.01,
        maximum=100.0,
    ),
    Parameter("steering.turn_rate", 1.0, "its largest turn rate", unit="rad/s", maximum=10.0),
    Parameter(
        "steering.turn_acceleration",
        1.5,
        "of its turn rate",
        unit="rad/s^2",
        minimum=0.01,
        maximum=100.0,
    ),
    Parameter(
        "steering.timeout",
        1.0,
        "simulated time after a command at which it stops, unless another one comes",
        unit="s",
        minimum=0.1,
        maximum=1e6,
    ),
)


@REFERENCES.register("steered", *PARAMETERS)
def _steered(character: Character, values: Values) -> Motion:
    if not character.layout.has_floating_base:
        raise ConfigurationError(
            f"reference 'steered' needs a floating base; '{character.name}' is fixed to the world"
        )
    names = expand_clips(character, values.texts("steering.clips")) or [
        values.text("steering.walk"),
        values.text("steering.run"),
    ]
    clamped: list[str] = []
    cycles = []
    for name in names:
        frames = read_clip(character, name)
        if not frames.wraps:
            raise ConfigurationError(f"clip '{name}' ends; to steer, it must wrap")
        clamped += frames.clamped
        clip = ClipReference(character.layout, frames)
        cycles.append(cycle_of(name, clip, float(frames.times[-1])))
    if values.texts("steering.clips"):
        cycles.sort(key=lambda cycle: cycle.speed)
    rest: FloatArray = np.array(character.rest_position)
    standing = standing_cycle(character.layout.configuration(rest), cycles[0].period)
    limits = SteeringLimits(
        values.number("steering.speed"),
        values.number("steering.acceleration"),
        values.number("steering.braking"),
        values.number("steering.turn_rate"),
        values.number("steering.turn_acceleration"),
        values.number("steering.timeout"),
    )
    reference = SteeredReference(
        character, Gait([standing, *cycles]), limits, rate_hz=values.integer(RATE.name)
    )
    warnings = (f"kept within joint limits: {', '.join(sorted(set(clamped)))}",) if clamped else ()
    return Motion(reference, warnings)
