"""Balls that are thrown into a world: what they do there is what mechanics says."""

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.runs.plan import RunPlan, make_plan
from controller_node.parameters import make_controller
from msgs_config.arrays import FloatArray
from msgs_config.errors import CommandError, ConfigurationError
from msgs_config.messages.throw import NUMBERS, ProjectileThrow, natural_radius, parse_throw
from msgs_config.parameters import Values
from sim_node.physics.balls.throws import MOST_BALLS, ThrowQueue
from sim_node.physics.mujoco.world import MujocoWorld
from sim_node.physics.settings import WorldSettings
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.physics import (
    DATA,
    LoneWorld,
    box_character,
    character,
    momentum,
    simulation,
)

pytestmark = pytest.mark.usefixtures("engine")

FREE_BOX = str(DATA / "free_box.yaml")
RATE = 240
STEP = 1.0 / RATE
WEIGHTLESS = {"gravity": 0.0, "terrain": "none"}
AT_CHEST = ProjectileThrow(2.0, 0.1, (2.3, 0.02, 1.2), (-8.0, 0.0, 1.0))
FAR = ProjectileThrow(3.0, 0.1, (5.0, 5.0, 0.4), (1.0, 0.0, 0.0))  # falls, and rolls on the ground


def ball_momentum(throw: ProjectileThrow, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Linear (N s) and angular momentum (N m s, about the world's origin) of a solid ball."""
    centre, velocity, turning = motion[:3], motion[7:10], motion[10:]
    linear = throw.mass * velocity
    inertia = 0.4 * throw.mass * throw.radius**2
    return linear, np.cross(centre, linear) + inertia * turning


def as_thrown(throw: ProjectileThrow) -> FloatArray:
    """Its motion (13,) when it is let go."""
    return np.array((*throw.position, 0.0, 0.0, 0.0, 1.0, *throw.velocity, 0.0, 0.0, 0.0))


def in_bytes(rows: Sequence[FloatArray]) -> bytes:
    return b"".join(row.tobytes() for row in rows)


@pytest.fixture
def block(tmp_path: Path) -> str:
    return str(box_character(tmp_path, "0.2 0.3 0.2").file)


@pytest.fixture
def wall(tmp_path: Path) -> str:
    return str(box_character(tmp_path, "0.2 4 4", fixed=True).file)


@pytest.fixture(scope="module")
def walk() -> RunPlan:
    return make_plan("humanoid", 1.0, {"reference": "clip", "clip": "walk"}, {}, {})


def fresh(plan: RunPlan) -> Simulation:
    return Simulation(
        [make_character_setup(plan.character, plan.simulator)],
        make_simulation_settings(plan.simulator),
    )


def walked(
    plan: RunPlan,
    simulation: Simulation,
    ticks: int,
    throws: Mapping[int, Sequence[ProjectileThrow]] | None = None,
) -> tuple[list[FloatArray], list[bool]]:
    """States (2 n + 13 m,), with those of the balls; whether a ball touched in each tick."""
    controller = make_controller(plan.character, plan.reference, plan.controller)
    (simulated,) = simulation.characters
    rows, hits = [], []
    for _ in range(ticks):
        effort, _ = controller.compute_effort(simulated.state, simulation.clock.stamp_ns(1))
        simulation.step([effort], None, (throws or {}).get(simulation.tick, ()))
        rows.append(
            np.concatenate(
                (
                    simulated.state.position,
                    simulated.state.velocity,
                    simulation.ball_motion().ravel(),
                )
            )
        )
        hits.append(_a_ball_touches(simulation))
    return rows, hits


def _a_ball_touches(simulation: Simulation) -> bool:
    world: Any = simulation._world
    if isinstance(world, MujocoWorld):
        return any(world.contacts()[1][ball.place.links.start] for ball in world.balls.balls)
    return any(number in world.touched_links() for number in world.balls.numbers)


# Flight


def test_a_ball_flies_as_thrown_things_do() -> None:
    throw = ProjectileThrow(2.0, 0.1, (1.0, 2.0, 3.0), (4.0, -1.0, 2.0))

    with simulation(FREE_BOX, terrain="none") as run:
        run.step([np.zeros(6)], None, [throw])
        for _ in range(99):
            run.step([np.zeros(6)])
        ((*at, x, y, z, w, vx, vy, vz, wx, wy, wz),) = run.ball_motion().tolist()

    # the engine's steps: velocity first, then the place (semi-implicit Euler)
    time = 100 * STEP
    fallen = 0.5 * 9.81 * time * (time + STEP)
    assert at == pytest.approx([1.0 + 4.0 * time, 2.0 - time, 3.0 + 2.0 * time - fallen], abs=1e-9)
    assert (vx, vy, vz) == pytest.approx((4.0, -1.0, 2.0 - 9.81 * time), abs=1e-9)
    assert (x, y, z, w, wx, wy, wz) == (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def test_a_ball_that_slides_begins_to_roll_at_five_sevenths_of_its_speed_and_rolls_on() -> None:
    throw = ProjectileThrow(2.0, 0.1, (5.0, 0.0, 0.1), (2.0, 0.0, 0.0))

    with simulation(FREE_BOX, solver_iterations=50) as run:
        run.step([np.zeros(6)], None, [throw])
        speeds = []
        for _ in range(480):
            run.step([np.zeros(6)])
            speeds.append(run.ball_motion()[0, 7])

    assert speeds[-1] == pytest.approx(2.0 * 5.0 / 7.0, rel=2e-3)  # a solid ball's, whatever slips
    assert speeds[-1] == pytest.approx(speeds[240], rel=1e-6)  # nothing slows it down


# Impact


def test_momentum_is_conserved_through_an_impact_on_a_free_body(block: str) -> None:
    throw = ProjectileThrow(0.5, 0.05, (1.0, 0.06, 0.02), (-3.0, 0.0, 0.0))  # beside its middle
    before = np.concatenate(ball_momentum(throw, as_thrown(throw)))

    with simulation(block, **WEIGHTLESS) as run:
        impulse = np.zeros(3)
        run.watches_contacts = True
        run.step([np.zeros(6)], None, [throw])
        totals, turning = [], 0.0
        for _ in range(200):
            run.step([np.zeros(6)])
            its = np.concatenate(momentum(run.characters[0]._body, run.characters[0].character))
            totals.append(its + np.concatenate(ball_momentum(throw, run.ball_motion()[0])))
            turning = float(np.linalg.norm(its[3:]))
            contacts = run.characters[0].contacts
            assert contacts is not None
            impulse += STEP * contacts.wrenches[0, :3]

    assert turning > 0.01 and np.linalg.norm(impulse) > 0.5
    linear, angular = np.hsplit(np.array(totals) - before, 2)
    np.testing.assert_allclose(linear, 0.0, atol=1e-9)
    # each surface feels the force at its own place; they are in each other by up to a step's way
    depth = STEP * 3.0
    assert np.abs(angular).max() <= depth * np.linalg.norm(impulse)


def test_momentum_is_conserved_through_an_impact_on_a_humanoid() -> None:
    throw = ProjectileThrow(2.0, 0.1, (1.0, 0.03, 3.25), (-8.0, 0.0, 0.0))
    whole = character("humanoid")
    place, nothing = np.zeros(whole.layout.size), np.zeros(whole.layout.size)
    place[2] = 3.0

    with LoneWorld(whole, WorldSettings(gravity=0.0, ground=False)) as world:
        world.body.set_state(place, nothing)
        world.balls.add(throw)
        while not np.any(world.body.read()[1]):
            world.body.apply(nothing)
            world.step()
        ball, _ = ball_momentum(throw, world.balls.motion()[0])
        # the engine hands momentum over where the body is, and moves it afterwards
        world.body.set_state(place, world.body.read()[1])
        its, _ = momentum(world.body, whole)

    assert np.linalg.norm(its) > 5.0
    np.testing.assert_allclose(its + ball, (-16.0, 0.0, 0.0), atol=1e-6)


# Restitution is 0, but for what brings surfaces apart again: the share of a speed that this leaves.
# Bullet foresees a contact; MuJoCo finds it in each other by what a step goes, at the most.
REBOUND = {"bullet": 0.016, "mujoco": 0.07}


def test_the_impulse_on_what_cannot_move_is_all_that_the_ball_has(wall: str, engine: str) -> None:
    throw = ProjectileThrow(2.0, 0.1, (3.0, 0.0, 0.1), (-6.0, 0.0, 0.0))

    with simulation(wall, **WEIGHTLESS) as run:
        run.watches_contacts = True
        run.step([np.zeros(0)], None, [throw])
        impulse = np.zeros(3)
        for _ in range(RATE):
            run.step([np.zeros(0)])
            contacts = run.characters[0].contacts
            assert contacts is not None
            impulse += STEP * contacts.wrenches[0, :3]
        left = run.ball_motion()[0]

    assert 0.0 <= left[7] <= 6.0 * REBOUND[engine]
    np.testing.assert_allclose(impulse, (2.0 * (-6.0 - left[7]), 0.0, 0.0), atol=1e-9)


def test_balls_collide_with_each_other() -> None:
    one = ProjectileThrow(1.0, 0.1, (0.0, 5.0, 1.0), (2.0, 0.0, 0.0))
    other = ProjectileThrow(3.0, 0.2, (2.0, 5.0, 1.0), (-2.0, 0.0, 0.0))

    with simulation(FREE_BOX, **WEIGHTLESS) as run:
        run.step([np.zeros(6)], None, [one, other])
        for _ in range(2 * RATE):
            run.step([np.zeros(6)])
        first, second = run.ball_motion()[:, 7]

    assert 1.0 * first + 3.0 * second == pytest.approx(-4.0, abs=1e-9)
    assert 0.0 <= second - first <= 0.4  # of 4 m/s: what brings the surfaces apart again


# A character does not feel a ball before it is hit


def test_a_walk_is_the_same_to_the_bit_until_a_ball_touches(walk: RunPlan) -> None:
    with fresh(walk) as run:
        alone, _ = walked(walk, run, 200)
    with fresh(walk) as run:
        thrown, hits = walked(walk, run, 200, {30: [AT_CHEST], 31: [FAR]})

    size = 2 * walk.character.layout.size
    differs = [row for row in range(200) if not np.array_equal(alone[row], thrown[row][:size])]
    assert differs[0] == hits.index(True) > 60
    assert differs == list(range(differs[0], 200))


def test_the_same_throws_lead_to_the_same_states(walk: RunPlan) -> None:
    throws = {30: [AT_CHEST, FAR], 50: [AT_CHEST]}

    with fresh(walk) as run:
        one, _ = walked(walk, run, 150, throws)
        run.reset()
        assert run.balls == () and run.throws == ()
    with fresh(walk) as run:
        other, _ = walked(walk, run, 150, throws)

    assert in_bytes(one) == in_bytes(other)


# Balls whose time is over


def with_lifetime(plan: RunPlan, seconds: float) -> RunPlan:
    return replace(plan, simulator=Values({**plan.simulator, "ball_lifetime": seconds}))


def test_after_its_lifetime_a_ball_lies_far_away() -> None:
    lying = ProjectileThrow(4.0, 0.1, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0))
    with simulation(FREE_BOX, ball_lifetime=0.5, initial_position=[9.0, 9.0, 1.0, 0, 0, 0]) as run:
        nothing = np.zeros(run.characters[0].character.layout.size)
        places = []
        for tick in range(200):
            run.step([nothing], None, [[lying, AT_CHEST], [FAR]][tick] if tick < 2 else ())
            places.append(run.ball_motion()[:, :3])

    away = np.linalg.norm(places[2:], axis=2) > 5e3  # all three are there
    assert away.sum(axis=0).tolist() == [80, 80, 79]
    assert away[-80:, :2].all() and away[-79:, 2].all()
    np.testing.assert_allclose(places[-1][:, 2], 0.1, atol=2e-3)
    np.testing.assert_allclose(places[-1], places[-60], atol=1e-3)
    with pytest.raises(ConfigurationError, match="'ball_lifetime' is -1"):
        simulation(FREE_BOX, ball_lifetime=-1.0)


def test_what_stood_against_a_ball_falls_when_it_is_taken_away(block: str) -> None:
    """A box on a ball that cannot roll away, as it is between the box and the ground."""
    under = ProjectileThrow(50.0, 0.1, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0))
    begin = [0.0, 0.0, 0.31, 0.0, 0.0, 0.0]
    with simulation(block, ball_lifetime=0.25, initial_position=begin) as run:
        heights = []
        for tick in range(180):
            run.step([np.zeros(6)], None, [under] if not tick else ())
            heights.append(float(run.characters[0].state.position[2]))

    assert heights[55] == pytest.approx(0.3, abs=0.01)
    assert heights[-1] == pytest.approx(0.1, abs=0.01)


# States that are saved


@pytest.mark.parametrize("ticks", [20, 60, 110], ids=["before", "in flight", "after the impact"])
@pytest.mark.parametrize("lifetime", [0.0, 0.3], ids=["forever", "for a time"])
def test_a_saved_state_is_restored_whatever_was_thrown_since(
    walk: RunPlan, ticks: int, lifetime: float
) -> None:
    throws = {30: [AT_CHEST], 31: [FAR], 120: [AT_CHEST]}

    with fresh(with_lifetime(walk, lifetime)) as run:
        walked(walk, run, ticks, throws)
        early = run.snapshot()
        followed = in_bytes(walked(walk, run, 80, throws)[0])
        walked(walk, run, 20, {tick: [FAR] for tick in range(run.tick, run.tick + 20, 3)})
        late = run.snapshot()
        later = in_bytes(walked(walk, run, 20)[0])

        for saved, expected, count in (
            (early, followed, 80),
            (late, later, 20),
            (early, followed, 80),
        ):
            run.load_snapshot(saved)
            assert in_bytes(walked(walk, run, count, throws)[0]) == expected


@pytest.mark.parametrize("dirty", [0, 40], ids=["fresh", "with balls of its own"])
def test_another_simulation_takes_a_state_over_with_its_balls(walk: RunPlan, dirty: int) -> None:
    throws = {30: [AT_CHEST], 31: [FAR]}
    walk = with_lifetime(walk, 0.3)

    with fresh(walk) as run:
        walked(walk, run, 60, throws)
        snapshot = pickle.loads(pickle.dumps(run.snapshot()))
        expected = in_bytes(walked(walk, run, 80)[0])
    with fresh(walk) as other:
        walked(walk, other, dirty, {2: [FAR], 5: [FAR, FAR]})
        other.load_snapshot(snapshot)

        assert other.balls == (AT_CHEST, FAR)
        assert in_bytes(walked(walk, other, 80)[0]) == expected


# Throws that wait


def test_a_throw_waits_for_its_tick() -> None:
    schedule = ThrowQueue()
    for throw, tick in ((FAR, 7), (AT_CHEST, 3), (AT_CHEST, 7)):
        schedule.add(throw, tick)

    assert [schedule.take(tick) for tick in (3, 4, 7, 8)] == [[AT_CHEST], [], [FAR, AT_CHEST], []]


def test_an_episode_has_a_bounded_number_of_balls() -> None:
    schedule = ThrowQueue()
    for number in range(MOST_BALLS):
        schedule.add(FAR, 1 + number)
        schedule.take(number)

    with pytest.raises(CommandError, match=f"at most {MOST_BALLS} balls"):
        schedule.add(FAR, 5000)

    schedule.clear()
    schedule.add(FAR, 5000)


# What a throw is


def test_numbers_come_in_any_order_and_a_radius_may_be_left_out() -> None:
    names = ("vz", "vy", "vx", "z", "y", "x", "mass")

    throw = parse_throw(names, range(1, 8))

    assert throw == ProjectileThrow(7.0, natural_radius(7.0), (6.0, 5.0, 4.0), (3.0, 2.0, 1.0))
    assert 500.0 * 4.0 / 3.0 * pi * throw.radius**3 == pytest.approx(7.0)
    assert parse_throw(NUMBERS, throw.numbers().tolist()) == throw


GOOD = dict(zip(NUMBERS, (2.0, 0.1, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0), strict=True))
WRONG: dict[str, tuple[dict[str, float], list[str]]] = {
    "another name": ({"weight": 2.0}, ["'weight'", "mass"]),
    "no number": ({"x": np.nan}, ["x is nan", "finite"]),
    "no mass": ({"mass": 0.0}, ["mass is 0", "0.001 to 10000"]),
    "a mass below zero": ({"mass": -2.0}, ["mass is -2", "0.001 to 10000"]),
    "no size": ({"radius": 0.0}, ["radius is 0", "0.005 to 5"]),
    "too fast": ({"vy": 2e3}, ["2000 m/s", "at most 1000 m/s"]),
    "too far": ({"z": -2e6}, ["1e+06 m"]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_cannot_be_thrown_is_refused_in_a_line(wrong: str) -> None:
    other, expected = WRONG[wrong]
    numbers = GOOD | other

    with pytest.raises(CommandError) as caught:
        parse_throw(list(numbers), list(numbers.values()))

    line = str(caught.value)
    assert "\n" not in line and all(part in line for part in expected)


def test_a_throw_needs_each_number_once() -> None:
    for name in NUMBERS:
        rest = {key: value for key, value in GOOD.items() if key != name}
        if name == "radius":
            parse_throw(list(rest), list(rest.values()))
            continue
        with pytest.raises(CommandError, match=f"'{name}' is missing"):
            parse_throw(list(rest), list(rest.values()))
    with pytest.raises(CommandError, match="'mass' twice"):
        parse_throw([*GOOD, "mass"], [*GOOD.values(), 1.0])
    with pytest.raises(CommandError, match="8 names but 2 numbers"):
        parse_throw(list(GOOD), [1.0, 2.0])
