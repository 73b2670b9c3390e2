"""Pins: they hold what statics says, slip beyond their force, and are stable at any rate."""

import pickle
from collections.abc import Sequence
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.errors import CommandError
from sim_node.physics.pin_forces import YIELD_DISTANCE, PinForces
from sim_node.physics.pins import Pin, PinQueue, changed_pins
from tests.support.physics import (
    DAMPED,
    DATA,
    FLOATING_TURNED_FRAMES,
    LoneSimulation,
    character,
    joint_simulation,
    kinetic_energy,
    random_state,
    simulation,
)

FREE_BOX = str(DATA / "free_box.yaml")
BOX_MASS, GRAVITY = 2.0, 9.81  # kg, m/s^2
WEIGHT = BOX_MASS * GRAVITY  # N
RATES = [60, 240, 1000]
IN_AIR = {"terrain": "none"}
ORIGIN = (0.0, 0.0, 0.0)

engines = pytest.mark.usefixtures("engine")


def row_of(name: str, link: str) -> int:
    return [each.name for each in character(name).links].index(link)


def held(run: LoneSimulation, ticks: int, *pins: Pin) -> None:
    """Go on for some ticks without any effort; the pins change as they begin."""
    nothing = [np.zeros(run.layout.size)]
    for tick in range(ticks):
        run.step(nothing, pins=[pins if tick == 0 else ()])


def height(run: LoneSimulation) -> float:
    return float(run.state.position[2])


# Statics


@engines
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("substeps", [1, 3])
def test_a_box_that_hangs_yields_by_its_weight_over_the_stiffness(rate: int, substeps: int) -> None:
    with simulation(FREE_BOX, rate=rate, substeps=substeps, **IN_AIR) as run:
        held(run, 2 * rate, Pin(0, ORIGIN, ORIGIN, 2.0 * WEIGHT))

        stiffness = 2.0 * WEIGHT / YIELD_DISTANCE
        expected = WEIGHT / stiffness + GRAVITY / rate**2  # see `pin_forces`: f/k + h^2 W f
        assert height(run) == pytest.approx(-expected, abs=1e-9)
        assert np.abs(run.state.velocity).max() < 1e-9
        (push,) = run.simulated.pushes
        np.testing.assert_allclose(push.wrench, [0, 0, WEIGHT, 0, 0, 0], atol=1e-9)


@engines
def test_beyond_the_largest_force_it_slips_by_what_is_left_of_the_weight() -> None:
    with simulation(FREE_BOX, **IN_AIR) as run:
        held(run, 240, Pin(0, ORIGIN, ORIGIN, 0.75 * WEIGHT))
        fast = run.state.velocity[2]
        held(run, 120)

        assert run.state.velocity[2] - fast == pytest.approx(-0.25 * GRAVITY * 0.5)
        np.testing.assert_allclose(run.simulated.pushes[0].wrench[:3], [0.0, 0.0, 0.75 * WEIGHT])


@engines
def test_a_pendulum_that_is_held_aside_weighs_what_its_moment_says() -> None:
    """Its tip, at an angle, is held to a place ahead of it: moments about the hinge balance."""
    angle, end = 0.6, (0.0, 0.0, -1.0)
    place = (-np.sin(angle), 0.0, -np.cos(angle))
    rod = row_of("pendulum", "rod")
    with simulation("pendulum", initial_position=(angle,)) as run:
        held(run, 2 * 240, Pin(rod, place, end, 200.0))

        (push,) = run.simulated.pushes
        at = run.state.position[0]
        tip = np.array((-np.sin(at), 0.0, -np.cos(at)))
        moment = np.cross(tip, push.wrench[:3])[1]
        weight = np.cross(0.5 * tip, (0.0, 0.0, -GRAVITY))[1]
        assert moment == pytest.approx(-weight, abs=1e-6)
        assert np.abs(run.state.velocity).max() < 1e-6
        assert 0.0 < np.linalg.norm(tip - np.array(place)) < YIELD_DISTANCE


@engines
def test_what_is_let_go_falls_freely() -> None:
    with simulation(FREE_BOX, **IN_AIR) as run:
        held(run, 240, Pin(0, ORIGIN, ORIGIN, 3.0 * WEIGHT))
        held(run, 120, Pin(0, ORIGIN, ORIGIN, 0.0))

        assert run.simulated.pins == () and run.simulated.pushes == ()
        assert run.state.velocity[2] == pytest.approx(-0.5 * GRAVITY)


def test_it_comes_back_as_a_critically_damped_oscillator_does() -> None:
    """Without gravity, at a fine rate, its way is that of the closed form."""
    start, force = 0.01, 20.0
    with simulation(
        FREE_BOX, rate=2000, gravity=0.0, initial_position=(0, 0, start, 0, 0, 0), **IN_AIR
    ) as run:
        omega = sqrt(force / YIELD_DISTANCE / BOX_MASS)
        held(run, 1, Pin(0, ORIGIN, ORIGIN, force))
        for _ in range(10):
            held(run, 20)
            time = run.clock.stamp_ns(run.tick - 1) * 1e-9
            exact = start * (1.0 + omega * time) * np.exp(-omega * time)
            assert height(run) == pytest.approx(exact, abs=0.02 * start)


# Stability


@engines
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("force", [1.0, 300.0, 1e6])
def test_at_rest_a_pin_never_gives_energy(rate: int, force: float) -> None:
    """A moving chain in the air, pinned where it is at two points, loses its motion."""
    links = [row_of(FLOATING_TURNED_FRAMES, name) for name in ("hand", "arm")]
    rng = np.random.default_rng(4)
    size = character(FLOATING_TURNED_FRAMES).layout.size
    velocity = tuple((0.3 * rng.standard_normal(size)).tolist())
    settings: dict[str, Any] = {"rate": rate, "gravity": 0.0, "initial_velocity": velocity}
    with simulation(FLOATING_TURNED_FRAMES, **settings, **IN_AIR) as run:
        frames, _ = run.simulated.link_frames()
        pins = [Pin(link, tuple(frames[link].tolist()), ORIGIN, force) for link in links]
        whole = character(FLOATING_TURNED_FRAMES)
        first = energy = kinetic_energy(run.simulated._body, whole)
        held(run, 1, *pins)
        for _ in range(60):
            energy = kinetic_energy(run.simulated._body, whole)
            assert energy <= 1.01 * first
            held(run, max(rate // 120, 1))
        assert force < 2.0 or energy < first


@pytest.mark.parametrize("rate", [10, 60, 240, 1000, 5000])
@pytest.mark.parametrize("force", [1.0, 300.0, 1e6])
@pytest.mark.parametrize("substeps", [1, 4, 1000])
def test_no_motion_grows_from_tick_to_tick(rate: int, force: float, substeps: int) -> None:
    """The eigenvalues of the forces' own derivatives, with the whole mass matrix by numpy."""
    whole, rng = character("humanoid"), np.random.default_rng(7)
    position, still = random_state(whole, rng)[0], np.zeros(whole.layout.size)
    model, law = DynamicsModel(whole), PinForces(whole, 1.0 / rate)
    model.update(position, still)
    hands, size = [row_of("humanoid", f"{side}_wrist") for side in ("left", "right")], len(still)
    points = model.link_poses()[0][hands]
    pins = [Pin(*each, ORIGIN, force) for each in zip(hands, map(tuple, points), strict=True)]
    jacobian = np.vstack(
        [model.point_jacobian(*each)[:3] for each in zip(hands, points, strict=True)]
    )

    def generalised(at: FloatArray, velocity: FloatArray) -> FloatArray:
        pushes = law.wrenches(pins, at, velocity)
        return jacobian.T @ np.concatenate([push.wrench[:3] for push in pushes])

    small, step = 1e-8, 1.0 / rate
    mass = model.mass_matrix()
    by_velocity = np.array([generalised(position, small * each) for each in np.eye(size)]).T
    # of positions the forces are linear, too: K in place of C, from places that are moved
    law_at = np.zeros((size, size))
    for entry, each in enumerate(np.eye(size)):
        moved = (points - small * (jacobian @ each).reshape(-1, 3)).tolist()
        pins = [
            Pin(pin.link, tuple(place), ORIGIN, force)
            for pin, place in zip(pins, moved, strict=True)
        ]
        law_at[:, entry] = generalised(position, still)
    stiff, damped = (np.linalg.solve(mass, each / small) for each in (law_at, by_velocity))
    share = 0.5 * (1.0 + 1.0 / substeps) * step**2
    whole_step = np.block(
        [
            [np.eye(size) + share * stiff, step * np.eye(size) + share * damped],
            [step * stiff, np.eye(size) + step * damped],
        ]
    )
    assert np.abs(np.linalg.eigvals(whole_step)).max() < 1.0 + 1e-5


@engines
@pytest.mark.parametrize("rate", [60, 240, 1000])
def test_what_rests_on_its_place_is_not_moved(rate: int) -> None:
    with simulation(FREE_BOX, rate=rate, gravity=0.0, **IN_AIR) as run:
        held(run, rate, Pin(0, ORIGIN, ORIGIN, 1e6))

        assert not run.state.position.any() and not run.state.velocity.any()


@engines
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("force", [20.0, 1e6])
def test_a_light_hand_on_a_heavy_body_is_held_stably(rate: int, force: float) -> None:
    """The humanoid's own hands, straight arms, which a stiff explicit spring would blow up."""
    hands = [row_of("humanoid", f"{side}_wrist") for side in ("left", "right")]
    with simulation("humanoid", rate=rate, gravity=0.0, **IN_AIR) as run:
        frames, _ = run.simulated.link_frames()
        away = [tuple((frames[hand] + (0.002, 0.001, -0.002)).tolist()) for hand in hands]
        pins = [Pin(hand, place, ORIGIN, force) for hand, place in zip(hands, away, strict=True)]
        held(run, 1, *pins)
        energies = []
        for _ in range(30):
            held(run, rate // 30)
            energies.append(kinetic_energy(run.simulated._body, character("humanoid")))

        now, _ = run.simulated.link_frames()
        assert np.abs(now[hands] - np.array(away)).max() < 1e-3
        assert max(energies[15:]) < max(energies[:15])


def test_the_base_of_a_fixed_character_can_be_pinned_in_vain() -> None:
    with simulation("pendulum") as run, simulation("pendulum") as free:
        held(run, 100, Pin(0, (1.0, 0.0, 0.0), ORIGIN, 100.0))
        held(free, 100)

        assert run.state.position.tolist() == free.state.position.tolist()
        np.testing.assert_allclose(run.simulated.pushes[0].wrench[:3], [100.0, 0.0, 0.0])


# What it is a function of


@engines
@pytest.mark.parametrize("name", ["humanoid", DAMPED])
def test_from_a_snapshot_it_goes_on_to_the_bit_while_a_pin_acts(name: str) -> None:
    last = len(character(name).links) - 1
    pin = Pin(last, (0.2, 0.1, 1.1), (0.01, 0.0, 0.0), 80.0)
    with simulation(name) as run, simulation(name) as other:
        held(run, 60, pin)
        kept = pickle.loads(pickle.dumps(run.snapshot()))
        held(run, 60)
        other.load_snapshot(kept)
        assert other.simulated.pins == (pin,)
        held(other, 60)

        assert other.state.position.tobytes() == run.state.position.tobytes()
        assert other.state.velocity.tobytes() == run.state.velocity.tobytes()


@engines
def test_its_forces_as_pushes_lead_to_the_same_states() -> None:
    """So a replay needs the applied wrenches alone."""
    nothing = np.zeros(character("humanoid").layout.size)
    hand = row_of("humanoid", "right_wrist")
    with simulation("humanoid", substeps=2) as run, simulation("humanoid", substeps=2) as again:
        for tick in range(100):
            run.step(
                [nothing], pins=[[Pin(hand, (0.3, 0.0, 1.4), ORIGIN, 90.0)] if not tick else ()]
            )
            again.step([nothing], [run.simulated.pushes])
            assert again.state.position.tobytes() == run.state.position.tobytes()


@engines
def test_a_reset_lets_all_go_and_equals_a_fresh_world() -> None:
    with simulation("humanoid") as run, simulation("humanoid") as fresh:
        held(run, 30, Pin(3, (0.0, 0.0, 2.0), ORIGIN, 300.0))
        run.reset()
        held(run, 30)
        held(fresh, 30)

        assert run.simulated.pins == ()
        assert run.state.position.tobytes() == fresh.state.position.tobytes()


@engines
def test_of_two_characters_each_has_its_own_pins() -> None:
    given = {"characters": ["left", "right"], "character": FREE_BOX, "terrain": "none"}
    places = {"left.initial_position": (0.0,) * 6, "right.initial_position": (2.0, *(0.0,) * 5)}
    with joint_simulation({**given, **places}) as run:
        nothing = [np.zeros(6)] * 2
        changes: Sequence[Sequence[Pin]] = [(), [Pin(0, (2.0, 0.0, 0.0), ORIGIN, 3.0 * WEIGHT)]]
        for tick in range(240):
            run.step(nothing, pins=changes if tick == 0 else None)

        left, right = (each.state for each in run.characters)
        assert left.velocity[2] == pytest.approx(-GRAVITY)
        assert abs(right.velocity[2]) < 1e-6
        assert right.position[0] == pytest.approx(2.0)


# The queue

HUMANOID = character("humanoid")
NO_ROWS = np.zeros((0, 3))


def add(queue: PinQueue, link: str, force: float, place: float = 0.0, first_tick: int = 5) -> None:
    queue.add([link], np.full((1, 3), place), NO_ROWS, np.array([force]), first_tick=first_tick)


def test_changes_come_at_their_tick_in_the_order_in_which_they_were_sent() -> None:
    queue = PinQueue(HUMANOID)
    add(queue, "neck", 10.0, first_tick=7)
    add(queue, "neck", 20.0, 1.0)
    add(queue, "neck", 30.0, 2.0)

    assert queue.take(4) == []
    assert [(pin.force, pin.place) for pin in queue.take(5)] == [
        (20.0, (1.0, 1.0, 1.0)),
        (30.0, (2.0, 2.0, 2.0)),
    ]
    assert queue.take(6) == []
    assert [pin.force for pin in queue.take(7)] == [10.0]
    assert queue.take(8) == []


def test_a_link_has_one_pin_and_they_are_in_the_order_of_links() -> None:
    def pin(link: int, force: float) -> Pin:
        return Pin(link, ORIGIN, ORIGIN, force)

    first = changed_pins((), [pin(4, 1.0), pin(2, 1.0)])
    assert [each.link for each in first] == [2, 4]
    assert changed_pins(first, [pin(4, 0.0), pin(3, 2.0), pin(2, 5.0)]) == (
        pin(2, 5.0),
        pin(3, 2.0),
    )
    assert changed_pins((), [pin(1, 1.0), pin(1, 0.0)]) == ()


NAN = float("nan")
REFUSED: list[tuple[list[str], FloatArray, FloatArray, FloatArray, str]] = [
    ([], NO_ROWS, NO_ROWS, np.zeros(0), "an empty pin"),
    (["nose"], np.zeros((1, 3)), NO_ROWS, np.ones(1), "nose"),
    (["neck"], np.zeros((1, 3)), NO_ROWS, np.ones(2), "1 links but 2 wrenches"),
    (["neck"], NO_ROWS, NO_ROWS, np.ones(1), "1 links but 0 transforms"),
    (["neck"], np.zeros((1, 3)), np.zeros((2, 3)), np.ones(1), "1 links but 2 twists"),
    (["neck"], np.zeros((1, 3)), NO_ROWS, -np.ones(1), "largest force on 'neck' is -1 N"),
    (["neck"], np.zeros((1, 3)), NO_ROWS, np.full(1, 2e6), "0.001 to 1e"),
    (["neck"], np.zeros((1, 3)), NO_ROWS, np.full(1, NAN), "largest force on 'neck' is nan N"),
    (["neck"], np.full((1, 3), NAN), NO_ROWS, np.ones(1), "the place of 'neck' is not finite"),
    (["neck"], np.full((1, 3), 1e7), NO_ROWS, np.ones(1), "beyond 1e"),
    (["neck"], np.zeros((1, 3)), np.full((1, 3), NAN), np.ones(1), "the point of 'neck'"),
]


@pytest.mark.parametrize(("names", "places", "points", "forces", "sentence"), REFUSED)
def test_what_cannot_be_is_refused_whole_and_in_a_sentence(
    names: list[str], places: FloatArray, points: FloatArray, forces: FloatArray, sentence: str
) -> None:
    queue = PinQueue(HUMANOID)

    with pytest.raises(CommandError, match=sentence):
        queue.add(names, places, points, forces, first_tick=1)

    assert queue.take(1) == []


def test_letting_go_needs_no_place() -> None:
    queue = PinQueue(HUMANOID)

    queue.add(["neck", "chest"], NO_ROWS, NO_ROWS, np.zeros(2), first_tick=3)

    assert [pin.force for pin in queue.take(3)] == [0.0, 0.0]


def test_a_hostile_sender_does_not_fill_the_memory() -> None:
    queue = PinQueue(HUMANOID)
    names = ["neck"] * 10_000
    queue.add(names, np.zeros((10_000, 3)), NO_ROWS, np.ones(10_000), first_tick=9)

    with pytest.raises(CommandError, match="more than 10000 pins wait"):
        add(queue, "neck", 1.0)


def test_a_turned_character_is_held_at_its_point() -> None:
    """The point is one of the link's frame: a box that is turned hangs from its corner."""
    corner = (0.1, 0.0, 0.0)
    turned = (0.0, 0.0, 0.0, 0.0, 0.0, pi / 2)
    with simulation(FREE_BOX, initial_position=turned, **IN_AIR) as run:
        held(run, 1, Pin(0, (0.0, 0.1, 0.0), corner, 100.0))

        assert not run.simulated.pushes[0].wrench[:3].round(9).any()  # it is there already
        assert run.simulated.pushes[0].point.tolist() == list(corner)
