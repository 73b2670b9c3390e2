"""The controller's answers, and what becomes of characters that it drives, in one process."""

from dataclasses import replace

import numpy as np
import pytest

from controller_node.controller import Controller
from controller_node.references.clip import ClipReference
from controller_node.references.trajectory import points_of_lists
from controller_node.strength import strengths_of
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import ROOT
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ClockError
from msgs_config.messages.state import StampedState
from sim_node.physics.simulation import Simulation
from tests.support.physics import character, controller, run_together, simulation

RATE = 240
HUMANOID = character("humanoid").layout
ARM = [f"panda_joint{number}" for number in range(1, 8)]


def walker(**given: object) -> Controller:
    """The humanoid's controller that plays the walk."""
    return controller("humanoid", reference="clip", clip="walk", **given)


def walking(assisted: bool) -> Simulation:
    """The humanoid in the walk's first state."""
    start = ClipReference(HUMANOID, read_clip(character("humanoid"), "walk")).sample(0.0)
    return simulation(
        "humanoid",
        rate=RATE,
        commanded_joints=[ROOT] * assisted + HUMANOID.actuated_joint_names,
        initial_position=start.configuration.position.tolist(),
        initial_velocity=start.velocity.tolist(),
    )


def stamp(tick: int) -> int:
    """The stamp of a tick, ns."""
    return tick * 10**9 // RATE


def states(count: int) -> list[StampedState]:
    """States of the humanoid near its rest pose, tick after tick."""
    rng = np.random.default_rng(1)
    rest = np.array(character("humanoid").rest_position)
    return [
        StampedState(
            stamp_ns=stamp(tick),
            position=rest + rng.normal(scale=0.1, size=HUMANOID.size),
            velocity=rng.normal(size=HUMANOID.size),
            effort=None,
        )
        for tick in range(1, count + 1)
    ]


# --- answers -------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["stable_pd", "pd"])
def test_the_same_state_gets_the_same_answer_whatever_was_asked_before(law: str) -> None:
    # Arrange
    driver = walker(law=law)
    sequence = states(10)
    first = [driver.compute_effort(state, stamp(1)) for state in sequence]

    # Act
    backwards = [driver.compute_effort(state, stamp(1)) for state in reversed(sequence)][::-1]
    alone = [walker(law=law).compute_effort(state, stamp(1)) for state in sequence]

    # Assert
    for answers in zip(first, backwards, alone, strict=True):
        efforts, references = zip(*answers, strict=True)
        assert len({effort.tobytes() for effort in efforts}) == 1
        assert len({reference.position.tobytes() for reference in references}) == 1
        assert len({reference.velocity.tobytes() for reference in references}) == 1


def test_an_answer_leaves_the_state_alone() -> None:
    state = states(1)[0]
    before = replace(state, position=state.position.copy(), velocity=state.velocity.copy())

    walker().compute_effort(state, stamp(1))

    np.testing.assert_array_equal(state.position, before.position)
    np.testing.assert_array_equal(state.velocity, before.velocity)


def test_later_answers_leave_earlier_ones_alone() -> None:
    # Arrange
    driver = walker()
    effort, reference = driver.compute_effort(states(1)[0], stamp(1))
    before = effort.copy(), reference.position.copy(), reference.velocity.copy()

    # Act
    for state in states(5):
        driver.compute_effort(state, stamp(1))

    # Assert
    after = effort, reference.position, reference.velocity
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("law", ["stable_pd", "pd"])
def test_the_reference_is_that_at_the_states_stamp_since_the_episode_began(law: str) -> None:
    # Arrange
    driver, episode = walker(law=law), 7
    clip = ClipReference(HUMANOID, read_clip(character("humanoid"), "walk"))
    for state in states(30)[episode - 1 :]:
        # Act
        _, reference = driver.compute_effort(state, stamp(episode))

        # Assert
        expected = clip.sample((state.stamp_ns - stamp(episode)) / 1e9)
        assert reference.stamp_ns == state.stamp_ns
        np.testing.assert_array_equal(reference.position, expected.configuration.position)
        np.testing.assert_array_equal(reference.velocity, expected.velocity)


@pytest.mark.parametrize("law", ["stable_pd", "pd"])
def test_without_assistance_nothing_is_asked_of_the_root(law: str) -> None:
    helped, alone = walker(law=law), walker(law=law, root_assistance=False)
    for state in states(5):
        assert np.all(helped.compute_effort(state, stamp(1))[0][:6] != 0.0)
        assert np.all(alone.compute_effort(state, stamp(1))[0][:6] == 0.0)
        assert np.all(alone.compute_effort(state, stamp(1))[0][6:] != 0.0)


def test_efforts_are_clipped_to_the_controllers_limits() -> None:
    # Arrange
    free = walker(law="pd")
    bound = walker(law="pd", **{"effort_limit.chest": 5.0, "effort_limit.left_knee": 3.0})
    chest, knee = (HUMANOID.joint(name).entries for name in ("chest", "left_knee"))
    state = states(1)[0]

    # Act
    wanted, given = (driver.compute_effort(state, stamp(1))[0] for driver in (free, bound))

    # Assert
    np.testing.assert_allclose(given[chest], wanted[chest] * 5.0 / np.linalg.norm(wanted[chest]))
    np.testing.assert_allclose(given[knee], 3.0 * np.sign(wanted[knee]))


@pytest.mark.parametrize("first", [2, 3, 4, 100, 1001])
def test_an_episode_is_answered_alike_whatever_tick_it_begins_at(first: int) -> None:
    """Though the stamps' differences, whole ns, are not alike at 240 Hz."""
    begun, later = walker(), walker()
    for state in states(12):
        tick = round(state.stamp_ns * RATE / 1e9) - 1
        moved = replace(state, stamp_ns=stamp(first + tick))

        effort, reference = later.compute_effort(moved, stamp(first))

        expected, desired = begun.compute_effort(state, stamp(1))
        assert effort.tobytes() == expected.tobytes()
        assert reference.position.tobytes() == desired.position.tobytes()


def test_changed_gains_count_from_the_next_state_on() -> None:
    # Arrange
    driver, doubled = walker(law="pd"), walker(law="pd", **{"gain_scale.p": 2.0})
    first, second = states(2)
    driver.compute_effort(first, stamp(1))

    # Act
    driver.settings = doubled.settings

    # Assert
    effort, _ = driver.compute_effort(second, stamp(1))
    np.testing.assert_array_equal(effort, doubled.compute_effort(second, stamp(1))[0])


def test_a_state_at_another_rate_is_a_clock_error() -> None:
    with pytest.raises(ClockError, match="4166666 ns is no tick at 1000 Hz"):
        controller("humanoid", rate=1000).compute_effort(states(1)[0], stamp(1))


# --- driven characters ---------------------------------------------------------------------------


def test_the_walk_with_assistance_is_tracked_and_stays_up() -> None:
    errors = []
    with walking(assisted=True) as run:
        for state, _, reference in run_together(run, walker(rate=RATE), 2 * RATE):
            assert state.position[2] > 0.8 * reference.position[2]
            errors.append(tracking_error(state.position, reference.position))

    assert np.mean(errors) < 0.1


def test_the_walk_without_assistance_falls() -> None:
    heights = []
    with walking(assisted=False) as run:
        for state, effort, reference in run_together(
            run, walker(rate=RATE, root_assistance=False), 2 * RATE
        ):
            assert not effort[:6].any()
            heights.append(state.position[2] / reference.position[2])

    assert min(heights[: RATE // 4]) > 0.8
    assert min(heights) < 0.5


def tracking_error(position: FloatArray, target: FloatArray) -> float:
    """Mean of the joints' errors, rad, the root's left out."""
    error = HUMANOID.difference(HUMANOID.configuration(position), HUMANOID.configuration(target))
    return float(HUMANOID.norms(error)[2:].mean())


def test_the_panda_settles_where_its_springs_carry_its_weight() -> None:
    # Arrange: every joint of the arm 0.3 rad off
    panda = character("franka_panda")
    arm = np.array([panda.layout.joint(name).start for name in ARM])
    rest = np.array(panda.rest_position)
    start = rest.copy()
    start[arm] += 0.3
    driver = controller("franka_panda", rate=RATE)
    with simulation("franka_panda", rate=RATE, initial_position=start.tolist()) as run:
        # Act
        for _ in run_together(run, driver, 6 * RATE):
            pass
        last = run.state

    # Assert
    model = DynamicsModel(panda)
    model.update(last.position, np.zeros_like(rest))
    weight = model.bias_force()[arm]
    stiffness = driver.settings.gains.stiffness[arm]
    error = (rest - last.position)[arm]
    assert np.abs(last.velocity).max() < 1e-4
    assert np.abs(weight).max() > 10.0
    np.testing.assert_allclose(error, weight / stiffness, rtol=0.02, atol=1e-4)


def test_an_episode_of_the_same_stamp_that_is_begun_has_nothing_of_the_one_before() -> None:
    # Arrange
    driver, (first, second, third) = walker(law="pid"), states(3)
    before = [driver.compute_effort(state, stamp(1))[0].tobytes() for state in (first, second)]
    weak = strengths_of(HUMANOID, ("chest",), (0.5,), stamp(2))
    driver.set_strengths(weak, episode_ns=stamp(1))
    points = points_of_lists(["left_knee"], [0.5], [[-1.0]], [[]], [[]])
    driver.set_trajectory(points, start_ns=stamp(3), now_ns=stamp(3), episode_ns=stamp(1))
    driver.compute_effort(third, stamp(1))

    # Act
    driver.begin_episode(stamp(1))

    # Assert
    again = [driver.compute_effort(state, stamp(1))[0].tobytes() for state in (first, second)]
    assert again == before


@pytest.mark.parametrize("kind", ["trajectory", "strengths"])
def test_what_comes_ahead_of_an_episodes_first_state_counts_in_that_episode(kind: str) -> None:
    before, *sent = states(6)
    ahead = stamp(2)

    def answers(episode: int | None) -> bytes:
        """In the episode that begins with tick 2, after what was sent for some episode."""
        driver = walker()
        driver.compute_effort(before, stamp(1))
        if kind == "trajectory" and episode is not None:
            points = points_of_lists(["left_knee"], [0.1], [[-1.0]], [[]], [[]])
            driver.set_trajectory(points, start_ns=ahead, now_ns=ahead, episode_ns=episode)
        elif episode is not None:
            weak = strengths_of(HUMANOID, ("left_knee",), (0.1,), ahead)
            driver.set_strengths(weak, episode_ns=episode)
        return np.array([driver.compute_effort(state, ahead)[0] for state in sent]).tobytes()

    assert answers(stamp(1)) == answers(None)
    assert answers(ahead) != answers(None)
