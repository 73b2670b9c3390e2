"""What a search for corrections depends on, and its presets for each clip."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from controller_node.feedback_gains import checked_gains
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.joint_layout import JointLayout

_LARGEST_SEED = 2**32 - 2  # one more has still to be a seed of numpy
PRESETS = Path(__file__).with_name("presets.yaml")


@dataclass(frozen=True)
class Weights:
    """What the differences from the motion cost; each is about 0.1 where it begins to be seen."""

    pose: float = 3.0  # a rad of joint angle, mean of the joints
    root: float = 20.0  # a rad of the root's orientation, and 0.1 of its angular velocity in rad/s
    end_effectors: float = 20.0  # a m of height, mean of the end effectors
    balance: float = 60.0  # a height of the character, of the centre of mass above each of them
    centre: float = 60.0  # a m of the centre of mass
    ahead: float = 30.0  # a m of where it gets to as it moves
    momentum: float = 0.0  # a kg m^2/s of angular momentum


@dataclass(frozen=True)
class Bounds:
    """Beyond them a sample is lost, and is not gone on from."""

    centre: float = 0.4  # m, of the centre of mass from the motion's
    root: float = 1.2  # rad, of the root's orientation


@dataclass(frozen=True)
class Settings:
    """A search's settings: the same ones give the same result on any number of processes."""

    samples: int = 1000  # a window
    kept: int = 80  # of them, at most
    window: float = 0.1  # s
    seed: int = 1
    tries: int = 6  # failures without getting any further, going back further each time
    lookahead: int = 3  # windows beyond it, left to the feedback, whose costs count too
    refined: float = 0.5  # share of the samples that are drawn around the best of the others
    # largest offset of each joint that is corrected, rad or m, one number a degree of freedom
    noise: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    feedback: Mapping[str, float] = field(default_factory=dict)  # gains by name; none: without
    window_feedback: str = ""  # name or path of its gains; empty: without
    feedforward: float = 0.0  # share of the offsets of the motion's inverse dynamics to begin with
    gains: Mapping[str, float] = field(default_factory=dict)  # of the controller, by parameter
    weights: Weights = Weights()
    bounds: Bounds = Bounds()

    def largest_offsets(self, layout: JointLayout) -> FloatArray:
        """The noise (n,), zero of what is not corrected; rad or m."""
        largest = np.zeros(layout.size)
        for name, widths in self.noise.items():
            largest[layout.joint(name).entries] = widths
        return largest

    def dividing(self, cycle: float, windows: int | None = None) -> "Settings":
        """The same with so many windows a cycle of a length in s, or as many as there are about."""
        return replace(self, window=cycle / (windows or max(round(cycle / self.window), 1)))

    def content(self) -> dict[str, Any]:
        """The settings as JSON has them."""
        noise = {name: list(row) for name, row in self.noise.items()}
        return asdict(self) | {"noise": noise}


def preset(character: str, clip: str, rate_hz: int | None = None, **given: object) -> Settings:
    """The settings for a clip by name, or else for any of the character's, with some given.

    Those of the control rate, if there are any, take the place of those of the clip.

    Raises:
        ConfigurationError: there is none for the character, or a value is wrong.
    """
    content = yaml.safe_load(PRESETS.read_text(encoding="utf-8"))
    if character not in content:
        raise ConfigurationError(
            f"{one_of('character to reconstruct', character, sorted(content))}"
        )
    values: dict[str, Any] = dict(content[character]["default"])
    presets = content[character]
    for name, value in presets.get(f"{clip}@{rate_hz}", presets.get(clip, {})).items():
        adds = isinstance(value, dict) and name != "feedback"  # gains belong together
        values[name] = {**values.get(name, {}), **value} if adds else value
    return settings_from({**values, **given})


def settings_from(content: Mapping[str, Any]) -> Settings:
    """The settings that a mapping says, such as `Settings.content` gives it.

    Raises:
        ConfigurationError: a name or a value is wrong.
    """
    known = {item.name for item in fields(Settings)}
    for name in content:
        if name not in known:
            raise ConfigurationError(one_of("setting", name, sorted(known)))
    values = dict(content)
    values["noise"] = {
        name: tuple(float(number) for number in row) for name, row in values["noise"].items()
    }
    for name, kind in (("weights", Weights), ("bounds", Bounds)):
        if isinstance(values.get(name), Mapping):
            values[name] = replace(kind(), **values[name])
    values["feedback"] = checked_gains(values.get("feedback", {}))
    values["gains"] = _numbers(values.get("gains", {}))
    settings = Settings(**values)
    for name, least, most in (
        ("seed", 0, _LARGEST_SEED),
        ("samples", 1, 1_000_000),
        ("kept", 1, 100_000),
        ("tries", 1, 1000),
        ("lookahead", 0, 100),
    ):
        if not least <= getattr(settings, name) <= most:
            raise ConfigurationError(
                f"{name} is {getattr(settings, name)}; it must be {least} to {most}"
            )
    if not isinstance(settings.window_feedback, str):
        raise ConfigurationError(
            f"window_feedback is {settings.window_feedback!r}; it must be text"
        )
    if not 0.0 <= settings.feedforward <= 10.0:
        raise ConfigurationError(f"feedforward is {settings.feedforward}; it must be 0 to 10")
    if not 0.0 < settings.window <= 10.0:
        raise ConfigurationError(f"window is {settings.window} s; it must be above 0, at most 10 s")
    return settings


def _numbers(gains: object) -> dict[str, float]:
    """Gains by the names of the controller's parameters; which there are, the plan checks."""
    if not isinstance(gains, Mapping):
        raise ConfigurationError(f"gains is {gains!r}; it must be a mapping of names to numbers")
    for name, gain in gains.items():
        if isinstance(gain, bool) or not isinstance(gain, int | float):
            raise ConfigurationError(f"{name} is {gain!r}; it must be a number")
    return {str(name): float(gain) for name, gain in gains.items()}
