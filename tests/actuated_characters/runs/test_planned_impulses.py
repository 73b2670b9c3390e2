"""Pushes that are given as impulses from a side of the character."""

import math

import numpy as np
import pytest

from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.wrenches import parse_push
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations


@pytest.fixture(scope="module")
def plan() -> RunPlan:
    return make_plan("humanoid", 2.0, {"reference": "hold"}, {"wrench_duration": 0.2}, {})


@pytest.mark.parametrize(
    ("side", "direction"),
    [
        ("front", (-1.0, 0.0, 0.0)),
        ("left", (0.0, -1.0, 0.0)),
        ("back", (1.0, 0.0, 0.0)),
        ("right", (0.0, 1.0, 0.0)),
        ("above", (0.0, 0.0, -1.0)),
        ("30", (-math.sqrt(0.75), -0.5, 0.0)),
    ],
)
def test_an_impulse_is_a_force_away_from_its_side_while_it_lasts(
    plan: RunPlan, side: str, direction: tuple[float, float, float]
) -> None:
    push = parse_push(f"impulse=20 from={side} at=1.5 target=chest", plan)

    assert push.link == "chest"
    np.testing.assert_allclose(push.wrench[:3], 100.0 * np.array(direction), atol=1e-9)
    assert push.wrench[3:] == (0.0, 0.0, 0.0)
    assert push.stamp_ns == parse_push("chest:1,0,0@1.5", plan).stamp_ns


def test_sides_turn_with_the_way_that_the_reference_faces() -> None:
    plan = make_plan("humanoid", 3.0, {"clip": "spin"}, {}, {})
    orientation = plan.reference.sample(0.75).configuration.orientations_xyzw[0]
    ahead = rotations.rotate(orientation, np.array((1.0, 0.0, 0.0)))
    yaw = math.atan2(ahead[1], ahead[0])
    assert abs(yaw) > 0.5

    wrench = parse_push("impulse=10 from=back at=0.75 target=root", plan).wrench

    assert math.remainder(math.atan2(wrench[1], wrench[0]) - yaw, math.tau) == pytest.approx(
        0.0, abs=0.3
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("impulse=20 at=1", "'target' is missing; write it as 'impulse=20 from=left at=1.5"),
        (
            "impulse=20 at=1 target=chest side=left",
            "unknown key 'side'; there are: impulse, at,",
        ),
        ("impulse=much at=1 target=chest", "impulse is 'much'; it must be a number"),
        ("impulse=9 at=1 target=chest from=up", "from is 'up'; it must be an angle in degrees"),
        ("impulse=9 at=1 target=tail", "unknown link 'tail'"),
        ("impulse=9 at=3 target=chest", "time is 3.0 s; it must be 0 s to less than 2 s"),
        ("impulse=9 at=1 at=2 target=chest", "'at' twice"),
    ],
)
def test_a_wrong_impulse_is_one_line(plan: RunPlan, text: str, message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        parse_push(text, plan)

    assert message in str(error.value)
    assert "\n" not in str(error.value)
