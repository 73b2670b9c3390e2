"""Simulations of the Python API that are kept and continued; and what reads of contacts find."""

import pickle

import numpy as np
import pytest

import actuated_characters as ac
from msgs_config.arrays import FloatArray

UNAIDED: dict[str, object] = {"root_assistance": False}


@pytest.fixture(scope="module")
def walker() -> ac.Controller:
    return ac.Controller(ac.load_character("humanoid"), UNAIDED, clip="walk")


def go_on(controller: ac.Controller, simulation: ac.Simulation, ticks: int) -> list[bytes]:
    """The states that follow under control, bit for bit."""
    states = []
    for _ in range(ticks):
        state = simulation.step(controller.compute_effort(simulation.state))
        states.append(state.position.tobytes() + state.velocity.tobytes())
    return states


@pytest.mark.parametrize("ticks", [0, 60])
def test_a_simulation_goes_on_from_a_snapshot_to_the_bit(walker: ac.Controller, ticks: int) -> None:
    with ac.Simulation(walker.character, walker.start) as simulation:
        go_on(walker, simulation, ticks)
        simulation.push("chest", (60.0, 0.0, 0.0))
        saved = simulation.snapshot()
        followed, states = go_on(walker, simulation, 30), simulation.state_hash

        restored = simulation.restore(saved)

        assert (restored.effort is None) == (ticks == 0)
        assert (simulation.ticks, simulation.time) == (ticks, ticks / 240)
        assert go_on(walker, simulation, 30) == followed
        assert simulation.state_hash == states

    with ac.Simulation(walker.character, walker.start) as other:
        go_on(walker, other, 5)
        other.restore(pickle.loads(pickle.dumps(saved)))
        assert go_on(walker, other, 30) == followed


def test_a_snapshot_of_another_simulation_is_refused(walker: ac.Controller) -> None:
    with (
        ac.Simulation(walker.character, walker.start) as one,
        ac.Simulation(walker.character, walker.start, gravity=3.7) as lighter,
        ac.Simulation(ac.load_character("pendulum")) as other,
    ):
        for wrong in (lighter, other):
            with pytest.raises(ac.ActuatedCharactersError, match="both must be the same"):
                one.restore(wrong.snapshot())
        assert one.state.effort is None


@pytest.mark.parametrize("substeps", [1, 3])
def test_contacts_are_the_same_whether_they_are_read_in_each_tick_or_once(
    walker: ac.Controller, substeps: int
) -> None:
    def fall(simulation: ac.Simulation, ticks: int, *, reads: bool) -> FloatArray:
        for _ in range(ticks):
            simulation.step(np.zeros(34))
            if reads:
                _ = simulation.contacts
        return simulation.contacts

    for ticks in (40, 90, 150):
        with (
            ac.Simulation(walker.character, walker.start, substeps=substeps) as often,
            ac.Simulation(walker.character, walker.start, substeps=substeps) as once,
        ):
            seen = fall(often, ticks, reads=True)
            assert np.array_equal(fall(once, ticks, reads=False), seen)
            assert often.state_hash == once.state_hash
            assert np.abs(seen).max() > 1.0
