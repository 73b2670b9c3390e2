"""The parameters that simulator and controller have in common, and must agree on."""

from msgs_config.parameters import Parameter

DEFAULT_CHARACTER = "humanoid"

CHARACTER = Parameter(
    "character", DEFAULT_CHARACTER, "name of a shipped character, or path of a .yaml file"
)
RATE = Parameter("rate", 240, "control ticks a second", unit="Hz", minimum=1, maximum=100_000)
GRAVITY = Parameter("gravity", 9.81, "gravity along -z", unit="m/s^2", maximum=1000.0)
