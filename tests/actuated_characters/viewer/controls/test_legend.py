"""The legend says what the colours mean that are on the page, and no others."""

import pytest

from actuated_characters.viewer.controls.legend import legend
from actuated_characters.viewer.controls.pace import Pace
from actuated_characters.viewer.parameters import SHOWN

NOTHING = dict.fromkeys(SHOWN, False)
SAYS = {
    "reference": "where it should be",
    "forces": "push",
    "balance": "centre of mass",
    "torques": "nearer its limit",
    "skin": "right side",
}


@pytest.mark.parametrize("name", SHOWN)
def test_it_tells_what_is_shown_alone(name: str) -> None:
    text = legend({**NOTHING, name: True}, has_sides=True, has_feet=True, one_of_several=False)

    assert [each for each, said in SAYS.items() if said in text] == [name]


def test_it_is_empty_where_nothing_is_shown_and_tells_of_sides_only_where_there_are_some() -> None:
    assert legend(NOTHING, has_sides=True, has_feet=True, one_of_several=True) == ""
    assert (
        legend({**NOTHING, "skin": True}, has_sides=False, has_feet=True, one_of_several=True) == ""
    )
    assert "each character" in legend(
        {**NOTHING, "skin": True}, has_sides=True, has_feet=True, one_of_several=True
    )


def test_the_pace_is_simulated_time_over_wall_time_of_the_last_seconds() -> None:
    pace = Pace()

    said = [pace.measure("/a", 0.5 * now, now) for now in (10.0, 10.2, 11.0, 12.0)]

    assert said == ["", "", *["0.5 × real time, "] * 2]
    assert pace.measure("/a", 9.0, 13.0) == "1.8 × real time, "
    assert [pace.measure("/a", 9.0, now) for now in (14.0, 16.0)][1] == "time rests, "


def test_the_pace_is_measured_anew_after_a_reset_and_for_another_character() -> None:
    pace = Pace()
    pace.measure("/a", 1.0, 1.0)
    assert pace.measure("/a", 2.0, 2.0)

    assert pace.measure("/a", 0.1, 3.0) == ""
    assert pace.measure("/b", 5.0, 4.0) == ""
