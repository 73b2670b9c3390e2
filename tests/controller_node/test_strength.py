"""Strengths of joints: shares of gains and limits, by parameter, and from a stamp on."""

from collections.abc import Mapping

import numpy as np
import pytest

from controller_node.control_laws import scale_gains
from controller_node.controller import Controller
from controller_node.strength import Strengths, strength_schedule, strengths_of
from msgs_config.arrays import FloatArray
from msgs_config.errors import ActuatedCharactersError, MotionError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from tests.support.physics import character, controller, random_state

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
CLOCK = TickClock(240)
FIRST_NS = CLOCK.stamp_ns(1)
ELBOW, CHEST = (LAYOUT.joint(name).entries for name in ("left_elbow", "chest"))


def state(tick: int = 1, seed: int = 4) -> StampedState:
    position, velocity = random_state(HUMANOID, np.random.default_rng(seed))
    return StampedState(CLOCK.stamp_ns(tick), position, velocity, None)


def effort(given: Mapping[str, object], strengths: Strengths | None = None) -> FloatArray:
    driver = controller("humanoid", **given)
    if strengths is not None:
        driver.set_strengths(strengths, episode_ns=FIRST_NS)
    return driver.compute_effort(state(), FIRST_NS)[0]


def of(start_ns: int = FIRST_NS, **by_joint: float) -> Strengths:
    return strengths_of(LAYOUT, tuple(by_joint), tuple(by_joint.values()), start_ns)


UNLIMITED = {f"effort_limit.{name}": np.inf for name in HUMANOID.vector_names}


@pytest.mark.parametrize("by_topic", [False, True])
def test_half_as_strong_a_joint_has_half_the_effort_of_an_explicit_law(by_topic: bool) -> None:
    whole = effort({"law": "pd", **UNLIMITED})
    half = (
        effort({"law": "pd", **UNLIMITED}, of(chest=0.5))
        if by_topic
        else effort({"law": "pd", **UNLIMITED, "strength.chest": 0.5})
    )

    expected = whole.copy()
    expected[CHEST] *= 0.5
    assert half.tolist() == expected.tolist()


def test_half_as_strong_a_joint_has_half_the_limit() -> None:
    far = {"law": "pd", "gain_scale.p": 1000.0}
    whole, half = effort(far), effort(far, of(chest=0.5))

    assert np.linalg.norm(whole[CHEST]) == pytest.approx(200.0)
    assert np.linalg.norm(half[CHEST]) == pytest.approx(100.0)
    assert half[ELBOW].tolist() == whole[ELBOW].tolist()


@pytest.mark.parametrize("law", ["stable_pd", "computed_torque", "pd_gravity", "pid"])
def test_a_joint_of_no_strength_has_no_effort_whatever_the_law_adds(law: str) -> None:
    limp = effort({"law": law, **UNLIMITED}, of(left_elbow=0.0))

    assert limp[ELBOW].tolist() == [0.0]
    assert np.abs(limp[CHEST]).max() > 0.0


def test_all_strengths_at_one_change_no_bit() -> None:
    driver = controller("humanoid")
    gains = driver.settings.gains

    assert scale_gains(LAYOUT, gains, np.ones(len(LAYOUT.vector_starts))) is gains
    assert effort({}, of(chest=1.0)).tobytes() == effort({}).tobytes()


def test_parameter_and_message_multiply() -> None:
    both = effort({"law": "pd", **UNLIMITED, "strength.chest": 0.5}, of(chest=0.5))

    whole = effort({"law": "pd", **UNLIMITED})
    assert both[CHEST] == pytest.approx(0.25 * whole[CHEST])


def chest_effort(driver: Controller, tick: int, episode_ns: int = FIRST_NS) -> list[float]:
    driven: list[float] = driver.compute_effort(state(tick), episode_ns)[0][CHEST].tolist()
    return driven


def test_strengths_count_from_exactly_their_tick_until_the_next_or_the_episodes_end() -> None:
    driver = controller("humanoid", law="pd", **UNLIMITED)
    driver.set_strengths(of(CLOCK.stamp_ns(4), chest=0.0), episode_ns=FIRST_NS)
    driver.set_strengths(of(CLOCK.stamp_ns(3), chest=0.5), episode_ns=FIRST_NS)

    whole, same, half, none = (np.array(chest_effort(driver, tick)) for tick in (1, 2, 3, 4))
    assert same.tolist() == whole.tolist()
    assert half.tolist() == (0.5 * whole).tolist()
    assert not none.any()
    driver.set_strengths(of(CLOCK.stamp_ns(5), neck=0.5), episode_ns=FIRST_NS)
    assert chest_effort(driver, 5) == whole.tolist()  # what is not named is at 1 again
    driver.set_strengths(of(CLOCK.stamp_ns(6), chest=0.0), episode_ns=FIRST_NS)
    assert not np.any(chest_effort(driver, 6))
    assert chest_effort(driver, 7, episode_ns=CLOCK.stamp_ns(7)) == whole.tolist()


@pytest.mark.parametrize(
    ("names", "values", "word"),
    [
        (("tail",), (0.5,), "tail"),
        (("root",), (0.5,), "root"),
        (("chest_x",), (0.5,), "chest_x"),
        (("chest", "chest"), (0.5, 0.5), "twice"),
        (("chest",), (1.5,), "1.5"),
        (("chest",), (-0.1,), "-0.1"),
        (("chest",), (float("nan"),), "nan"),
        (("chest", "neck"), (0.5,), "2 names"),
    ],
)
def test_wrong_strengths_are_refused_in_a_line(
    names: tuple[str, ...], values: tuple[float, ...], word: str
) -> None:
    with pytest.raises(MotionError, match=word) as refused:
        strengths_of(LAYOUT, names, values, FIRST_NS)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("value", [1.5, -0.1, float("nan")])
def test_a_parameter_outside_of_0_to_1_is_refused(value: float) -> None:
    with pytest.raises(ActuatedCharactersError, match=r"strength\.chest"):
        controller("humanoid", **{"strength.chest": value})


def test_the_root_has_no_strength() -> None:
    with pytest.raises(ActuatedCharactersError, match=r"strength\.root"):
        controller("humanoid", **{"strength.root": 0.5})


def test_too_many_that_wait_are_refused() -> None:
    schedule = strength_schedule(LAYOUT)
    for number in range(100):
        schedule.add(of(number, chest=0.5))

    with pytest.raises(MotionError, match="100"):
        schedule.add(of(100, chest=0.5))
