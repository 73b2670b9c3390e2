"""Numbers, sequences and paths of any kind are those of Python; what is none stays as it is."""

import array
import enum
import math
from collections import deque
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import Any, cast

import numpy as np
import pytest

from msgs_config.errors import CommandError, ConfigurationError
from msgs_config.plain_values import as_plain, finite_numbers, plain_parameters


class Law(str, enum.Enum):  # noqa: UP042 (as it was written before Python 3.11)
    STABLE_PD = "stable_pd"


class Count(enum.IntEnum):
    TWO = 2


class Meters(float):
    """A float of somebody's own."""


class Tensor:
    """An array of another library."""

    def tolist(self) -> list[float]:
        return [1.5, 2.0]


SAME: list[tuple[object, object]] = [
    (True, True),
    (3, 3),
    (2.5, 2.5),
    ("text", "text"),
    (np.bool_(True), True),
    (np.array(False), False),
    (np.int64(-7), -7),
    (np.uint8(255), 255),
    (np.array(8), 8),
    (Count.TWO, 2),
    (np.float64(1.62), 1.62),
    (np.float32(0.5), 0.5),
    (np.float16(0.5), 0.5),
    (np.longdouble(0.5), 0.5),
    (np.array(0.5), 0.5),
    (Fraction(1, 4), 0.25),
    (Meters(2.5), 2.5),
    (np.str_("walk"), "walk"),
    (Law.STABLE_PD, "stable_pd"),
    (Path("/robots/r.urdf"), "/robots/r.urdf"),
    (PurePosixPath("clip.txt"), "clip.txt"),
    ((1, 2.0), [1, 2.0]),
    (np.array([1, 2]), [1, 2]),
    (np.array([1.0, 2.0], dtype=np.float32), [1.0, 2.0]),
    (np.array(["a", "b"]), ["a", "b"]),
    ([np.float64(1.0), np.int32(2), Path("p")], [1.0, 2, "p"]),
    (np.array([1, Fraction(1, 2)], dtype=object), [1, 0.5]),
    (range(3), [0, 1, 2]),
    (deque([1.0]), [1.0]),
    (array.array("d", [1.0, 2.0]), [1.0, 2.0]),
    (Tensor(), [1.5, 2.0]),
    ((), []),
]


@pytest.mark.parametrize(("value", "expected"), SAME, ids=lambda each: type(each).__name__)
def test_a_value_becomes_pythons_own(value: object, expected: object) -> None:
    converted = as_plain(value)
    assert converted == expected
    assert type(converted) is type(expected)
    if isinstance(converted, list) and isinstance(expected, list):
        assert list(map(type, converted)) == list(map(type, expected))


@pytest.mark.parametrize(
    "value",
    [None, 1j, b"text", {"a": 1}, {1.0}, Decimal("1.5"), np.float64, Fraction(10**400), object()],
    ids=lambda each: type(each).__name__,
)
def test_what_is_none_of_these_stays(value: object) -> None:
    assert as_plain(value) is value


def test_what_is_not_finite_stays_a_number() -> None:
    assert as_plain(np.float32(np.inf)) == math.inf
    assert math.isnan(cast(float, as_plain(np.array(np.nan))))


def test_a_list_of_lists_is_not_followed() -> None:
    inner = [np.float64(1.0)]
    converted = as_plain([inner, inner])
    assert isinstance(converted, list)
    assert converted[0] is inner


def test_parameters_are_merged_and_the_last_counts() -> None:
    merged = plain_parameters({"rate": np.int64(240), "clip": Path("a")}, {"clip": "b"})
    assert merged == {"rate": 240, "clip": "b"}
    assert type(merged["rate"]) is int


@pytest.mark.parametrize("parameters", [None, 5, [("rate", 240)], "rate"])
def test_parameters_that_are_no_mapping_are_refused(parameters: object) -> None:
    with pytest.raises(ConfigurationError, match="must be a mapping"):
        plain_parameters(cast(Mapping[str, object], parameters))
    with pytest.raises(ConfigurationError, match="name is 5; it must be a text"):
        plain_parameters(cast(Mapping[str, object], {5: 1.0}))


@pytest.mark.parametrize(
    "numbers", [(1, 2, 3), [1.0, 2.0, 3.0], np.array([1, 2, 3]), (np.float32(1), Fraction(2), 3)]
)
def test_three_finite_numbers_are_an_array(numbers: Any) -> None:
    found = finite_numbers("it", numbers, 3, CommandError)
    assert found.dtype == np.float64
    assert found.tolist() == [1.0, 2.0, 3.0]


NOT_THREE = {
    "two": ((1, 2), "it is [1, 2]; it must be 3 finite numbers"),
    "four": (np.zeros(4), "it is [0.0, 0.0, 0.0, 0.0]; it must be 3 finite numbers"),
    "many": (np.zeros(1000), "it is a list; it must be 3 finite numbers"),
    "one": (10.0, "it is 10.0; it must be 3 finite numbers"),
    "none": (None, "it is None; it must be 3 finite numbers"),
    "nan": ((0, math.nan, 0), "it is [0, nan, 0]; it must be 3 finite numbers"),
    "inf": (np.array([0, 0, math.inf]), "it is [0.0, 0.0, inf]; it must be 3 finite numbers"),
    "too large": ((0, 0, 10**400), "it must be 3 finite numbers"),
    "a text": ("123", "it is '123'; it must be 3 finite numbers"),
    "texts": (["1", "2", "3"], "it is ['1', '2', '3']; it must be 3 finite numbers"),
    "flags": ((True, 0, 0), "it is [True, 0, 0]; it must be 3 finite numbers"),
    "complex": ((1j, 0, 0), "it must be 3 finite numbers"),
    "a column": (np.zeros((3, 1)), "it must be 3 finite numbers"),
    "a mapping": ({"x": 1}, "it is a dict; it must be 3 finite numbers"),
}


@pytest.mark.parametrize(("numbers", "message"), NOT_THREE.values(), ids=NOT_THREE)
def test_what_is_not_three_finite_numbers_is_refused(numbers: object, message: str) -> None:
    with pytest.raises(CommandError) as caught:
        finite_numbers("it", numbers, 3, CommandError)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300
