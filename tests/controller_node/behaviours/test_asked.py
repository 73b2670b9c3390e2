"""What a behaviour is asked for, each from its stamp: to react, track, brace and get up."""

import numpy as np
import pytest

from controller_node.behaviours.asked import Ask, AskedBehaviour, asked_behaviour
from controller_node.control_laws import GainArrays, TrackingInput
from controller_node.controller import Controller
from msgs_config.arrays import FloatArray
from msgs_config.errors import MotionError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from tests.support.struck import HUMANOID, LINKS, RATE_HZ, driver

LAYOUT = HUMANOID.layout
CLOCK = TickClock(RATE_HZ)
EPISODE_NS = CLOCK.stamp_ns(1)
NOTHING = np.zeros((len(LINKS), 6))


def struck(force: float) -> FloatArray:
    """The contacts of a tick in which a force, N, pushes the chest."""
    contacts = NOTHING.copy()
    contacts[LINKS.index("chest"), 0] = force
    return contacts


LIGHT, HARD = struck(2400.0), struck(24_000.0)  # 10 and 100 N s


def ask(control: Controller, what: Ask, tick: int) -> None:
    control.ask(AskedBehaviour(CLOCK.stamp_ns(tick), what), episode_ns=EPISODE_NS)


def answer(
    control: Controller, tick: int, contacts: FloatArray = NOTHING, *, lying: bool = False
) -> tuple[str, FloatArray]:
    """The mode and the effort that answer a state at rest, upright or on the back."""
    start = control._own_reference.sample(0.0)
    position = start.configuration.position.copy()
    if lying:
        position[2] = 0.15
        position[3:6] = 0.0, -0.5 * np.pi, 0.0
    effort = None if tick == 1 else np.zeros(LAYOUT.size)
    state = StampedState(CLOCK.stamp_ns(tick), position, 0.0 * position, effort)
    torque, _ = control.compute_effort(state, EPISODE_NS, contacts)
    assert control.mode is not None
    return control.mode.phase.mode.value, torque


@pytest.mark.parametrize("what", [Ask.TRACK, Ask.BRACE, Ask.GET_UP])
@pytest.mark.parametrize("behaviour", ["reactive", "active_ragdoll"])
def test_who_is_not_asked_to_react_takes_no_hit_until_it_is(behaviour: str, what: Ask) -> None:
    control = driver({"behaviour": behaviour})
    ask(control, what, 2)
    ask(control, Ask.REACT, 4)

    modes = [answer(control, tick, HARD if tick > 1 else NOTHING)[0] for tick in range(1, 5)]

    assert modes == ["TRACK", "TRACK", "TRACK", "LIMP"]


def test_without_a_word_it_reacts() -> None:
    control = driver({"behaviour": "reactive"})

    assert [answer(control, 1)[0], answer(control, 2, LIGHT)[0]] == ["TRACK", "REACT"]


def test_who_lies_gets_up_at_once_when_asked_and_who_stands_does_not() -> None:
    control = driver({"behaviour": "active_ragdoll"})
    ask(control, Ask.TRACK, 1)
    ask(control, Ask.GET_UP, 4)
    standing = driver({"behaviour": "active_ragdoll"})
    ask(standing, Ask.GET_UP, 4)

    modes = [answer(control, tick, lying=tick > 1)[0] for tick in range(1, 6)]

    assert modes == ["TRACK", "TRACK", "TRACK", "SEARCH", "BLEND"]
    assert control.mode is not None
    facts = control.mode.phase.facts
    assert (facts["to"], facts["clip"]) == ("clip", "getup_faceup")
    assert {answer(standing, tick)[0] for tick in range(1, 8)} == {"TRACK"}


def test_who_lies_limp_does_not_wait_until_it_is_still() -> None:
    def modes(*asks: tuple[Ask, int]) -> list[str]:
        control = driver({"behaviour": "active_ragdoll"})
        for what, tick in asks:
            ask(control, what, tick)
        return [answer(control, tick, lying=tick > 1)[0] for tick in range(1, 9)]

    assert modes()[1:] == ["LIMP"] * 7
    assert modes((Ask.GET_UP, 6))[4:] == ["LIMP", "SEARCH", "BLEND", "BLEND"]
    assert modes((Ask.TRACK, 6))[4:] == ["LIMP"] * 4  # what has begun is ended first


@pytest.mark.parametrize("behaviour", ["reactive", "active_ragdoll"])
def test_braced_joints_are_as_much_stiffer_as_is_said_with_the_same_damping_ratio(
    behaviour: str,
) -> None:
    control = driver({"behaviour": behaviour, "brace.stiffness": 9.0})
    used: list[GainArrays] = []
    law = control._effort

    def watched(instant: TrackingInput, gains: GainArrays) -> FloatArray:
        used.append(gains)
        return law(instant, gains)

    control._effort = watched  # type: ignore[method-assign]
    ask(control, Ask.BRACE, 2)
    ask(control, Ask.REACT, 3)

    for tick in range(1, 4):
        answer(control, tick)

    before, braced, after = used
    assert braced.stiffness[6:] == pytest.approx(9.0 * before.stiffness[6:])
    assert braced.damping[6:] == pytest.approx(3.0 * before.damping[6:])  # d / (2 sqrt(k m))
    np.testing.assert_array_equal(braced.stiffness[:6], before.stiffness[:6])
    np.testing.assert_array_equal(braced.effort_limits, before.effort_limits)
    np.testing.assert_array_equal(after.stiffness, before.stiffness)


def test_an_episode_forgets_what_was_asked_for() -> None:
    control = driver({"behaviour": "reactive"})
    ask(control, Ask.TRACK, 1)
    assert answer(control, 2, HARD)[0] == "TRACK"

    start = control._own_reference.sample(0.0)
    first = StampedState(CLOCK.stamp_ns(9), start.configuration.position, start.velocity, None)
    control.compute_effort(first, first.stamp_ns, NOTHING)
    second = StampedState(CLOCK.stamp_ns(10), first.position, first.velocity, np.zeros(LAYOUT.size))
    control.compute_effort(second, first.stamp_ns, HARD)

    assert control.mode is not None and control.mode.phase.mode.value == "LIMP"


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        ((), "behaviour: it has 0 names; it must have one of track, react, get_up, brace"),
        (("react", "brace"), "it has 2 names"),
        (("bracing",), "behaviour: unknown name"),
        (("getup",), "did you mean 'get_up'"),
    ],
)
def test_what_cannot_be_asked_for_is_said(names: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(MotionError, match=sentence):
        asked_behaviour(names, 0)


@pytest.mark.parametrize("behaviour", ["tracking", "ragdoll"])
def test_a_behaviour_without_reactions_cannot_be_asked(behaviour: str) -> None:
    with pytest.raises(MotionError, match="it must be active_ragdoll or reactive"):
        ask(driver({"behaviour": behaviour}), Ask.REACT, 1)
