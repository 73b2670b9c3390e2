"""One controller answers several simulations as a new one would: an episode keeps nothing."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pytest

import actuated_characters as ac
from tests.support.physics import character

TICKS = 60
PUSH_AT = 20


class Kind(NamedTuple):
    """A controller that remembers something from tick to tick."""

    character: str
    parameters: Mapping[str, object]
    link: str  # that is pushed
    push: tuple[float, float, float]  # N


KINDS = {
    "pid": Kind(
        "pendulum",
        {"gains.hinge.i": 50.0, "law": "pid", "reference": "sine"},
        "rod",
        (5.0, 0.0, 0.0),
    ),
    "active ragdoll": Kind(
        "humanoid", {"clip": "walk", "behaviour": "active_ragdoll"}, "chest", (0.0, -3000.0, 0.0)
    ),
    "reactive": Kind(
        "humanoid", {"clip": "walk", "behaviour": "reactive"}, "chest", (0.0, 900.0, 0.0)
    ),
    "walking machine": Kind(
        "humanoid", {"behaviour": "state_machine", "machine": "walk"}, "chest", (0.0, -3000.0, 0.0)
    ),
    "running machine": Kind(
        "humanoid", {"behaviour": "state_machine", "machine": "run"}, "chest", (0.0, 3000.0, 0.0)
    ),
    "jumping machine": Kind(
        "humanoid", {"behaviour": "state_machine", "machine": "jump"}, "chest", (3000.0, 0.0, 0.0)
    ),
    "steered": Kind("humanoid", {"reference": "steered"}, "chest", (0.0, 500.0, 0.0)),
}


def make_controller(kind: Kind) -> ac.Controller:
    return ac.Controller(character(kind.character), kind.parameters)


def simulate(kind: Kind, controller: ac.Controller, *, pushed: bool, ticks: int = TICKS) -> str:
    with ac.Simulation(controller.character, controller.start) as simulation:
        for tick in range(ticks):
            if pushed and tick == PUSH_AT:
                simulation.push(kind.link, force=kind.push)
            simulation.step(controller.compute_effort(simulation.state, simulation.contacts))
        return simulation.state_hash


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_a_second_simulation_gets_the_answers_of_a_new_controller(kind: Kind) -> None:
    fresh = simulate(kind, make_controller(kind), pushed=False)
    thrown = simulate(kind, make_controller(kind), pushed=True)
    controller = make_controller(kind)
    assert simulate(kind, controller, pushed=True) == thrown
    assert simulate(kind, controller, pushed=False) == fresh
    assert simulate(kind, controller, pushed=False, ticks=7)
    assert simulate(kind, controller, pushed=True) == thrown


def test_a_reset_begins_an_episode(kind: Kind = KINDS["pid"]) -> None:
    controller = make_controller(kind)
    with ac.Simulation(controller.character, controller.start) as simulation:
        efforts = []
        for _ in range(3):
            efforts.append(
                [
                    simulation.step(controller.compute_effort(simulation.state)).position[0]
                    for _ in range(20)
                ]
            )
            simulation.reset()
    assert efforts == [efforts[0]] * 3


def test_the_first_state_once_more_is_the_same_episode() -> None:
    kind = KINDS["pid"]
    once, twice = make_controller(kind), make_controller(kind)
    with ac.Simulation(once.character, once.start) as simulation:
        for tick in range(20):
            state = simulation.state
            effort = once.compute_effort(state)
            assert np.array_equal(twice.compute_effort(state), effort)
            if tick < 3:  # as a simulator that waits sends its state again, a copy of it
                again = ac.StampedState(
                    state.stamp_ns,
                    state.position.copy(),
                    state.velocity.copy(),
                    None if state.effort is None else state.effort.copy(),
                )
                assert np.array_equal(twice.compute_effort(again), effort)
            simulation.step(effort)


def test_what_begins_in_the_middle_goes_on_from_there() -> None:
    kind = KINDS["pid"]
    first, second = make_controller(kind), make_controller(kind)
    with ac.Simulation(first.character, first.start) as simulation:
        for _ in range(10):
            simulation.step(first.compute_effort(simulation.state))
        assert simulation.state.effort is not None
        assert second.compute_effort(simulation.state).shape == (1,)


def test_a_wrong_first_state_begins_no_episode() -> None:
    controller = make_controller(KINDS["pid"])
    between = ac.StampedState(17, np.zeros(1), np.zeros(1), None)
    with pytest.raises(ac.ActuatedCharactersError, match="no tick"):
        controller.compute_effort(between)
    fresh = simulate(KINDS["pid"], make_controller(KINDS["pid"]), pushed=False)
    assert simulate(KINDS["pid"], controller, pushed=False) == fresh


STATES: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "lying": lambda rng, size: np.concatenate(([0.0, 0.0, 0.1, 1.6, 0.0, 0.0], np.zeros(size - 6))),
    "under the ground": lambda rng, size: np.concatenate(([0, 0, -2.0], np.zeros(size - 3))),
    "upside down": lambda rng, size: np.concatenate(([0, 0, 1, 3.1, 0, 0], np.zeros(size - 6))),
    "far away": lambda rng, size: 100.0 * rng.normal(size=size),
    "tumbling": lambda rng, size: 3.0 * rng.normal(size=size),
}


@pytest.mark.parametrize("machine", ["walk", "run", "jump"])
@pytest.mark.parametrize("name", STATES)
def test_a_machine_answers_any_state_and_any_time(machine: str, name: str) -> None:
    humanoid, rng = character("humanoid"), np.random.default_rng(7)
    controller = ac.Controller(humanoid, behaviour="state_machine", machine=machine)
    size = humanoid.layout.size
    for ticks in (1, 2, 500, 3, 1, 20_000, 4):  # also an earlier time than before
        contacts = 1e3 * rng.normal(size=(len(humanoid.links), 6))
        position, velocity = STATES[name](rng, size), 20.0 * rng.normal(size=size)
        state = ac.StampedState(ticks * 1_000_000_000 // 240, position, velocity, np.zeros(size))
        effort = controller.compute_effort(state, contacts)
        assert np.isfinite(effort).all()
