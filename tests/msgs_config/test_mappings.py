"""A value of a mapping is of the right kind, or one line names place, key, value and kind."""

import math
from typing import Any

import pytest

from msgs_config.errors import ConfigurationError
from msgs_config.mappings import MappingReader

WRONG: dict[str, tuple[Any, str]] = {
    "number": (math.inf, "inf; it must be a finite number of at least 0"),
    "numbers": ([0.0, 4.0], "a list; it must be a list of 2 finite numbers from -1 to 1"),
    "names": (["a", 1], "a list; it must be a list of joint names"),
    "text": ("", "''; it must be a text"),
    "flag": (0, "0; it must be true or false"),
    "choice": ("x", "'x'; it must be 'z' or 'y'"),
    "part": ({1: 2}, "a dict; it must be a mapping"),
}
RIGHT = {
    "number": 2,
    "numbers": [0, 0.5],
    "names": ["a", "b"],
    "text": "a",
    "flag": True,
    "choice": "y",
    "part": {"a": 1},
}


def take(kind: str, value: object) -> object:
    """Take a value of a kind from below `outer.key`."""
    reader = MappingReader("file", {"outer": {"key": value}}, ConfigurationError).part("outer")
    if kind == "number":
        return reader.number("key", minimum=0.0)
    if kind == "numbers":
        return list(reader.numbers("key", 2, (-1.0, 1.0)))
    if kind == "names":
        return list(reader.names("key", "joint names"))
    if kind == "choice":
        return reader.choice("key", ["z", "y"])
    if kind == "part":
        return reader.part("key").content
    return reader.text("key") if kind == "text" else reader.flag("key")


@pytest.mark.parametrize("kind", RIGHT)
def test_a_right_value_is_taken(kind: str) -> None:
    assert take(kind, RIGHT[kind]) == RIGHT[kind]


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_value_is_refused_with_what_would_be_right(kind: str) -> None:
    value, line = WRONG[kind]

    with pytest.raises(ConfigurationError) as caught:
        take(kind, value)

    assert str(caught.value) == f"file: outer.key is {line}"


def test_an_unknown_key_is_refused_with_the_nearest_one() -> None:
    reader = MappingReader("file", {"part": {"stifness": 1}}, ConfigurationError)

    with pytest.raises(ConfigurationError, match=r"unknown key 'part\.stifness'; .*'stiffness'"):
        reader.part("part").check_keys(["stiffness", "damping"])
    with pytest.raises(ConfigurationError, match="is 1; it must be a mapping"):
        MappingReader("file", {"part": {"a": 1}}, ConfigurationError).parts("part", [])


@pytest.mark.parametrize("value", ["x" * 10**5, 10**400, [0] * 10**6], ids=["text", "int", "list"])
def test_a_value_of_any_size_is_shown_in_a_short_line(value: object) -> None:
    with pytest.raises(ConfigurationError) as caught:
        take("number", value)

    assert len(str(caught.value)) < 300
