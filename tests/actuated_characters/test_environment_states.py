"""Environments that are kept, continued, drawn, and run beside each other in several processes."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import gymnasium
import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.environments import TRACK
from actuated_characters.environments.track import TrackEnv, TrackState
from msgs_config.arrays import FloatArray

WALK: dict[str, Any] = {"clip": "walk", "random_start": True}
CASES: dict[str, dict[str, Any]] = {
    "targets": WALK,
    "torques": {**WALK, "action": "torques"},
    "delayed": {**WALK, "simulator": {"command_delay_ticks": 2, "substeps": 2}},
    "arm": {"character": "franka_panda", "reference": "sine", "random_start": True},
}

Rows = list[tuple[bytes, float, bool]]


def go_on(environment: TrackEnv, steps: int, *, seed: int = 5) -> Rows:
    """Random steps, and a new episode where one ends: all that they returned."""
    rng, rows = np.random.default_rng(seed), []
    space = environment.action_space
    assert isinstance(space, gymnasium.spaces.Box)
    for _ in range(steps):
        action = 0.3 * space.high * rng.uniform(-1.0, 1.0, space.shape)
        observation, reward, terminated, _, info = environment.step(action)
        rows.append((observation.tobytes(), reward, terminated))
        if terminated:
            rows.append((environment.reset()[0].tobytes(), info["reference_time"], False))
    return rows


def continue_elsewhere(options: dict[str, Any], state: bytes, steps: int) -> Rows:
    """The same steps in a new environment, which may be in another process."""
    environment = TrackEnv(**options)
    environment.reset(seed=99)
    go_on(environment, 3)
    environment.set_state(pickle.loads(state))
    rows = go_on(environment, steps)
    environment.close()
    return rows


@pytest.mark.parametrize("steps", [0, 7])
@pytest.mark.parametrize("case", CASES)
def test_what_follows_a_state_is_what_followed_it_to_the_bit(case: str, steps: int) -> None:
    environment = TrackEnv(**CASES[case])
    environment.reset(seed=4)
    go_on(environment, steps, seed=1)
    saved = environment.get_state()
    followed, states = go_on(environment, 30), environment.simulation.state_hash
    go_on(environment, 3, seed=2)

    for _ in range(2):
        observation, info = environment.set_state(saved)
        assert observation.tobytes() == saved.observation.tobytes()
        assert info["time"] == environment.simulation.time
        assert go_on(environment, 30) == followed
        assert environment.simulation.state_hash == states
    assert continue_elsewhere(CASES[case], pickle.dumps(saved), 30) == followed
    environment.close()


@pytest.mark.slow
def test_another_process_goes_on_to_the_bit() -> None:
    environment = TrackEnv(**WALK)
    environment.reset(seed=4)
    go_on(environment, 5)
    saved = pickle.dumps(environment.get_state())
    followed = go_on(environment, 30)
    environment.close()

    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert pool.submit(continue_elsewhere, WALK, saved, 30).result() == followed


def test_a_push_that_acts_goes_on_acting() -> None:
    environment = TrackEnv(clip="walk", simulator={"wrench_duration": 0.5})
    environment.reset(seed=0)
    environment.simulation.push("chest", (80.0, 0.0, 0.0))
    go_on(environment, 2)
    saved = environment.get_state()
    followed = go_on(environment, 10)
    other = TrackEnv(clip="walk", simulator={"wrench_duration": 0.5})
    other.reset(seed=0)
    other.set_state(saved)

    assert go_on(other, 10) == followed
    environment.set_state(saved)
    environment.reset(seed=0)
    other.reset(seed=0)
    assert go_on(environment, 10) == go_on(other, 10)
    for each in (environment, other):
        each.close()


@pytest.mark.parametrize(
    "other",
    [
        {"clip": "run"},
        {"clip": "walk", "action": "torques"},
        {"clip": "walk", "ticks_per_step": 4},
        {"clip": "walk", "controller": {"gains.neck.p": 1.0}},
        {"clip": "walk", "simulator": {"gravity": 3.7}},
        {"clip": "walk", "simulator": {"friction": 0.4}},
        {"character": "pendulum"},
    ],
    ids=str,
)
def test_a_state_of_other_options_is_refused(other: dict[str, Any]) -> None:
    one, another = TrackEnv(clip="walk"), TrackEnv(**other)
    another.reset(seed=0)
    before = another.simulation.state
    with pytest.raises(ac.ActuatedCharactersError, match=r"one of an environment|must be the same"):
        another.set_state(one.get_state())
    assert another.simulation.state is before
    for wrong in (None, "state", {}):
        with pytest.raises(ac.ActuatedCharactersError, match="not one of an environment"):
            one.set_state(wrong)  # type: ignore[arg-type]
    one.close()
    another.close()


def test_a_copy_says_what_to_do_instead() -> None:
    environment = TrackEnv("pendulum")
    for attempt in (copy.deepcopy, copy.copy, pickle.dumps):
        with pytest.raises(ac.ActuatedCharactersError, match=r"neither copied nor .* get_state"):
            attempt(environment)
    environment.close()


def test_to_close_one_twice_leaves_the_others_alone() -> None:
    drawn: dict[str, Any] = {"render_mode": "rgb_array", "render_size": (32, 32)}
    first = TrackEnv("pendulum", **drawn)
    first.render()
    first.close()
    second = TrackEnv("pendulum", **drawn)
    first.close()
    second.reset(seed=0)
    second.step(np.zeros(1))
    assert second.render() is not None
    second.close()


# Pictures


def test_a_picture_shows_the_character_as_it_is() -> None:
    environment = TrackEnv(clip="walk", render_mode="rgb_array", render_size=(120, 90))
    environment.reset(seed=0)
    first, again = environment.render(), environment.render()
    assert first is not None and again is not None
    assert (first.shape, first.dtype) == ((90, 120, 3), np.uint8)
    assert first.tobytes() == again.tobytes()
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 20  # ground, sky and limbs

    for _ in range(10):
        environment.step(np.zeros(28))
    moved = environment.render()
    assert moved is not None
    assert np.mean(np.any(moved != first, axis=2)) > 0.02
    environment.reset(seed=0)
    assert np.array_equal(environment.render(), first)
    environment.close()


def test_the_camera_goes_with_the_character() -> None:
    near = TrackEnv(clip="walk", render_mode="rgb_array", render_size=(120, 90))
    far = TrackEnv(clip="walk", render_mode="rgb_array", render_size=(120, 90))
    near.reset(seed=0)
    near.render()
    far.reset(seed=0)
    # of the chequerboard all is the same again one cycle of the walk on, but for its shift
    pictures = []
    for environment, start in ((near, 0.0), (far, 12 * 1.26666666)):
        environment.reset(seed=0, options={"start": start})
        pictures.append(environment.render())
    limbs = [
        np.ptp(picture.astype(int), axis=2) > 60 for picture in pictures if picture is not None
    ]
    assert limbs[0].sum() > 100
    assert np.mean(limbs[0] != limbs[1]) < 0.1
    near.close()
    far.close()


def test_without_a_mode_nothing_is_drawn_and_a_size_is_checked() -> None:
    environment = TrackEnv("pendulum")
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert environment.render() is None
    environment.close()
    with pytest.raises(ac.ActuatedCharactersError, match="size 4x5000 is not sensible"):
        TrackEnv("pendulum", render_mode="rgb_array", render_size=(4, 5000))


def test_gymnasiums_wrappers_collect_the_pictures() -> None:
    environment = gymnasium.make(
        TRACK, character="pendulum", render_mode="rgb_array_list", render_size=(32, 32)
    )
    environment.reset(seed=0)
    for _ in range(3):
        environment.step(np.zeros(1))
    assert np.shape(environment.render())[0] == 4
    environment.close()


# Several processes


@pytest.mark.slow
@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_environments_in_processes_of_their_own_are_those_of_one(context: str) -> None:
    def rows(**how: Any) -> tuple[list[FloatArray], Any]:
        several = gymnasium.make_vec(TRACK, num_envs=2, **how, **WALK)
        seen = [several.reset(seed=[7, 8])[0]]
        rng = np.random.default_rng(0)
        for _ in range(30):
            seen += several.step(0.2 * rng.normal(size=(2, 28)))[:2]
        states = several.call("get_state")
        several.close()
        return seen, states

    with TrackEnv("pendulum"):  # type: ignore[attr-defined]
        apart, states = rows(vectorization_mode="async", vector_kwargs={"context": context})
    together, _ = rows(vectorization_mode="sync")

    for one, other in zip(apart, together, strict=True):
        assert np.array_equal(one, other)
    assert all(isinstance(state, TrackState) for state in states)
