"""A simulation runs, is paused, or takes some steps; a fault stops it, and only some can go on."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from msgs_config.errors import CommandError
from sim_node.timing.run_control import RunControl


@pytest.fixture
def control() -> RunControl:
    return RunControl()


def paused(fault: str | None = None, *, diverged: bool = False) -> RunControl:
    control = RunControl()
    control.pause(fault, diverged=diverged)
    return control


# Pausing


def test_a_fault_is_remembered_until_it_goes_on() -> None:
    control = paused("a conflict")
    assert control.fault == "a conflict"

    control.pause()  # by hand, on top of it
    assert control.fault == "a conflict"
    control.pause("another conflict")
    assert control.fault == "another conflict"

    control.resume()
    assert control.fault is None


# Steps


@pytest.mark.parametrize("count", [1, 2, 5])
def test_it_takes_as_many_steps_as_it_should_and_is_paused_again(count: int) -> None:
    control = paused()

    control.begin_steps(count)
    last = []
    while control.runs:
        last.append(control.tick())

    assert last == [False] * (count - 1) + [True]
    assert control.paused
    assert control.steps_left == 0


def test_steps_forget_the_fault_that_they_go_on_from() -> None:
    control = paused("a conflict")

    control.begin_steps(1)

    assert control.fault is None


def test_steps_are_refused_while_it_runs(control: RunControl) -> None:
    with pytest.raises(CommandError, match="not paused"):
        control.begin_steps(3)

    assert control.runs
    assert control.steps_left == 0


def test_steps_are_refused_while_others_are_not_done() -> None:
    control = paused()
    control.begin_steps(3)
    control.tick()

    with pytest.raises(CommandError, match="2 steps of another call are not done"):
        control.begin_steps(5)

    assert control.steps_left == 2


# Stuck


def test_a_diverged_simulation_neither_goes_on_nor_takes_a_step_and_says_why() -> None:
    control = paused("diverged at tick 7", diverged=True)
    assert control.has_diverged

    for go_on in (control.resume, lambda: control.begin_steps(1)):
        with pytest.raises(CommandError, match="only ~/reset: diverged at tick 7"):
            go_on()

    assert not control.runs
    assert control.fault == "diverged at tick 7"


def test_a_pause_by_hand_does_not_loosen_a_divergence() -> None:
    control = paused("diverged at tick 7", diverged=True)

    control.pause()

    assert control.has_diverged
    with pytest.raises(CommandError, match="diverged at tick 7"):
        control.resume()


# Reset


def test_a_reset_ends_a_divergence_and_leaves_it_paused() -> None:
    control = paused("diverged at tick 7", diverged=True)

    control.reset()

    assert not control.has_diverged
    assert control.fault is None
    assert control.paused
    control.begin_steps(2)
    assert control.runs


# Everything at once


class AnyCalls(RuleBasedStateMachine):
    """All calls in any order keep it in one of four conditions: runs, paused, steps, diverged."""

    @initialize()
    def begin(self) -> None:
        self.control = RunControl()
        self.condition = "runs"
        self.left = 0

    @rule(diverged=st.booleans())
    def pause(self, diverged: bool) -> None:
        self.control.pause("a fault" if diverged else None, diverged=diverged)
        self.condition = "diverged" if diverged or self.condition == "diverged" else "paused"
        self.left = 0

    @rule()
    def resume(self) -> None:
        if self.condition == "diverged":
            with pytest.raises(CommandError):
                self.control.resume()
            return
        self.control.resume()
        self.condition, self.left = "runs", 0

    @rule(count=st.integers(1, 3))
    def begin_steps(self, count: int) -> None:
        if self.condition != "paused":
            with pytest.raises(CommandError):
                self.control.begin_steps(count)
            return
        self.control.begin_steps(count)
        self.condition, self.left = "steps", count

    @precondition(lambda self: self.condition in ("runs", "steps"))
    @rule()
    def tick(self) -> None:
        self.left = max(self.left - 1, 0)
        assert self.control.tick() == (self.condition == "steps" and self.left == 0)
        if self.condition == "steps" and self.left == 0:
            self.condition = "paused"

    @rule()
    def reset(self) -> None:
        self.control.reset()
        self.left = 0
        if self.condition != "runs":
            self.condition = "paused"

    @invariant()
    def it_is_as_the_rules_say(self) -> None:
        assert self.control.runs == (self.condition in ("runs", "steps"))
        assert self.control.paused == (self.condition != "runs")
        assert self.control.has_diverged == (self.condition == "diverged")
        assert self.control.steps_left == self.left
        if self.condition == "diverged":
            assert self.control.fault


TestAnyCalls = AnyCalls.TestCase
TestAnyCalls.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
