"""Settings: what a dataclass declares, and what it reads of the values of all parameters."""

from dataclasses import FrozenInstanceError

import pytest

from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Parameter, resolve
from msgs_config.settings import Settings, parameter, shared

RATE = Parameter("rate", 240, "ticks a second", unit="Hz", minimum=1)


class Turn(Settings, prefix="turn."):
    """Settings that are part of others."""

    limit: float = parameter(1.0, "a turn rate", unit="rad/s")
    region: str = "none"


class Gait(Settings, prefix="gait."):
    """One field of each type, and one that is no parameter."""

    rate_hz: int = shared(RATE)
    speed: float = parameter(1.5, "a speed", unit="m/s", minimum=-2.0, maximum=2.0, live=True)
    clips: tuple[str, ...] = parameter((), "clips")
    weights: tuple[float, ...] = parameter((1.0, 0.5), "weights", at_reset=True)
    kind: str = parameter("walk", "a kind", name="gait_kind", choices=("walk", "run"))
    turns: bool = parameter(True, "whether it turns")
    turn: Turn = Turn()
    ticks: int = 7


OTHERS = [RATE, Parameter("else", 0, "of another component")]


def test_each_parameter_has_the_field_s_name_below_the_prefix_and_its_facts() -> None:
    assert Gait.declared() == [
        Parameter("gait.speed", 1.5, "a speed", "m/s", minimum=-2.0, maximum=2.0, live=True),
        Parameter("gait.clips", [], "clips", texts=True),
        Parameter("gait.weights", [1.0, 0.5], "weights", at_reset=True),
        Parameter("gait_kind", "walk", "a kind", choices=("walk", "run")),
        Parameter("gait.turns", True, "whether it turns"),
        Parameter("turn.limit", 1.0, "a turn rate", "rad/s"),
    ]


def test_defaults_may_be_those_of_a_character() -> None:
    defaults = {each.name: each.default for each in Gait.declared(clips=["run"], speed=0.5)}

    assert (defaults["gait.clips"], defaults["gait.speed"]) == (["run"], 0.5)
    assert defaults["gait.weights"] == [1.0, 0.5]


def test_the_values_of_a_node_are_read_by_their_fields() -> None:
    given = {"rate": 100, "gait.speed": 1, "gait.clips": ["run"], "gait.weights": [2], "else": 3}

    settings = Gait.of(resolve(OTHERS + Gait.declared(), given))

    assert settings == Gait(100, 1.0, ("run",), (2.0,), "walk", True, Turn(), 7)
    assert isinstance(settings.speed, float)


def test_among_several_characters_names_begin_with_the_character_s() -> None:
    values = {f"left.{each.name}": each.default for each in [RATE, *Gait.declared()]}
    values |= {"left.gait.speed": 0.25, "left.turn.limit": 2.0}

    assert Gait.of(values, below="left.") == Gait(speed=0.25, turn=Turn(2.0))


def test_what_is_given_is_checked() -> None:
    assert Turn.given({"turn.limit": 2}) == Turn(2.0)

    with pytest.raises(ConfigurationError, match=r"'turn\.limit' is -1\.0; it must be 0 to 1e\+12"):
        Turn.given({"turn.limit": -1})
    with pytest.raises(ConfigurationError, match=r"turn\.limt"):
        Turn.given({"turn.limt": 1.0})


def test_a_change_of_parameters_leaves_what_is_none() -> None:
    settings = Gait(speed=1.0, turn=Turn(1.0, "a box"), ticks=9)

    changed = settings.changed(
        resolve([RATE, *Gait.declared()], {"gait.speed": 0.5, "turn.limit": 3.0})
    )

    assert changed == Gait(speed=0.5, turn=Turn(3.0, "a box"), ticks=9)


def test_settings_stay_as_they_are() -> None:
    with pytest.raises(FrozenInstanceError):
        Gait().speed = 2.0  # type: ignore[misc]


def test_a_default_of_another_type_than_the_field_s_is_a_mistake_of_the_program() -> None:
    with pytest.raises(AssertionError, match="speed"):

        class Wrong(Settings):
            speed: float = parameter(1, "a whole number as the default of a speed")
