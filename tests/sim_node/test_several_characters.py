"""Several characters in one world: each is as if alone, until they touch."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, SimulationError
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import character, joint_simulation

pytestmark = pytest.mark.slow

HUMANOID = character("humanoid").layout
LINKS = [link.name for link in character("humanoid").links]
TICKS = 360
FAR = {"characters": ["one", "other"], "other.placement": [0.0, 5.0, 0.0, 0.0]}
NEAR = {"characters": ["one", "other"], "other.placement": [0.25, 0.1, 0.0, 2.0]}

Efforts = Sequence[FloatArray]


def humanoid_efforts(seed: int, ticks: int = TICKS, size: float = 2.0) -> Efforts:
    """Random efforts in every joint, none on the root."""
    rng = np.random.default_rng(seed)
    motors = np.concatenate((np.zeros(6), np.ones(HUMANOID.size - 6)))
    return [size * motors * rng.normal(size=HUMANOID.size) for _ in range(ticks)]


def limp(name: str, ticks: int = TICKS) -> Efforts:
    return [np.zeros(character(name).layout.size)] * ticks


def trajectories(given: Mapping[str, object], *efforts: Efforts) -> list[bytes]:
    """Every bit of each actor's states."""
    with joint_simulation(given) as run:
        return states_of(run, *efforts)


def states_of(run: Simulation, *efforts: Efforts) -> list[bytes]:
    states = [b""] * len(run.characters)
    for together in zip(*efforts, strict=True):
        run.step(together)
        for number, simulated in enumerate(run.characters):
            states[number] += (
                simulated.state.position.tobytes() + simulated.state.velocity.tobytes()
            )
    return states


# --- each by itself ------------------------------------------------------------------------------


@pytest.mark.parametrize("given", [{}, {"substeps": 3}, {"command_delay_ticks": 2}], ids=str)
def test_far_apart_each_moves_as_if_it_were_alone_to_the_bit(given: dict[str, object]) -> None:
    one, other = humanoid_efforts(1), humanoid_efforts(2)

    together = trajectories(FAR | given, one, other)

    assert together[0] == trajectories(given, one)[0]
    assert together[1] == trajectories(given | {"placement": FAR["other.placement"]}, other)[0]


def test_characters_of_several_kinds_move_as_if_each_were_alone_to_the_bit() -> None:
    # one falls onto the ground from a metre up, while another swings
    kinds = {
        "arm": ("franka_panda", [5.0, 0.0, 0.0, 1.0]),
        "bob": ("pendulum", [0.0, -5.0, 2.0, 0.5]),
        "faller": ("humanoid", [0.0, 5.0, 1.0, -2.0]),
    }
    given: dict[str, object] = {"characters": list(kinds)}
    for name, (kind, place) in kinds.items():
        given |= {f"{name}.character": kind, f"{name}.placement": place}
    efforts = [limp("franka_panda"), [np.array([0.1])] * TICKS, humanoid_efforts(3)]

    together = trajectories(given, *efforts)

    for states, (kind, place), effort in zip(together, kinds.values(), efforts, strict=True):
        assert states == trajectories({"character": kind, "placement": place}, effort)[0]


def test_far_apart_the_order_of_the_characters_changes_no_bit() -> None:
    one, other = humanoid_efforts(1), humanoid_efforts(2)
    swapped = {**FAR, "characters": ["other", "one"]}

    first, second = trajectories(FAR, one, other)

    assert trajectories(swapped, other, one) == [second, first]


def test_a_push_moves_the_one_that_it_is_for() -> None:
    nothing = np.zeros(HUMANOID.size)
    push = ExternalWrench(LINKS.index("chest"), np.array([500.0, 0, 0, 0, 0, 0]), np.zeros(3), 1, 1)
    with joint_simulation(FAR) as pushed, joint_simulation(FAR) as left_alone:
        for tick in range(60):
            pushed.step([nothing, nothing], [[], [push]] if tick < 20 else None)
            left_alone.step([nothing, nothing])

        assert pushed.characters[1].pushes == ()
        one, other = (
            np.abs(mine.state.position - theirs.state.position).max()
            for mine, theirs in zip(pushed.characters, left_alone.characters, strict=True)
        )
    assert one == 0.0
    assert other > 0.1


# --- in contact ----------------------------------------------------------------------------------


@pytest.mark.parametrize("given", [{}, {"substeps": 2}], ids=str)
def test_a_run_in_contact_is_a_function_of_its_inputs(given: dict[str, object]) -> None:
    efforts = [humanoid_efforts(seed) for seed in (1, 2)]

    first = trajectories(NEAR | given, *efforts)

    assert trajectories(NEAR | given, *efforts) == first
    assert first != trajectories(FAR | given, *efforts)


def test_without_weight_and_ground_what_touches_presses_equally_in_opposite_directions() -> None:
    # one moves onto the other
    speed = [1.0] + [0.0] * (HUMANOID.size - 1)
    given = {
        "characters": ["one", "other"],
        "other.placement": [0.5, 0.1, 0.0, 0.0],
        "one.initial_velocity": speed,
        "gravity": 0.0,
        "terrain": "none",
        "substeps": 2,
    }
    nothing, largest = np.zeros(HUMANOID.size), 0.0
    with joint_simulation(given) as run:
        run.watches_contacts = True
        for _ in range(120):
            run.step([nothing, nothing])
            one, other = (
                simulated.contacts.wrenches[:, :3].sum(axis=0)
                for simulated in run.characters
                if simulated.contacts
            )

            np.testing.assert_allclose(one, -other, rtol=1e-9, atol=1e-9)
            largest = max(largest, float(np.abs(one).max()))
    assert largest > 10.0


# --- errors --------------------------------------------------------------------------------------


def test_a_divergence_names_the_character_and_the_joint() -> None:
    spin = [0.0] * HUMANOID.size
    spin[HUMANOID.joint("right_knee").entries.start] = -30.0
    nothing = np.zeros(HUMANOID.size)
    with (
        joint_simulation(FAR | {"other.initial_velocity": spin, "speed_limit": 20.0}) as run,
        pytest.raises(SimulationError, match="'other/right_knee'"),
    ):
        run.step([nothing, nothing])


def test_an_initial_state_of_the_wrong_length_names_the_character() -> None:
    with pytest.raises(ConfigurationError, match=r"'other\.initial_position' has 2 entries"):
        joint_simulation(FAR | {"other.initial_position": [0.0, 0.0]})
