"""Feet of a steered reference on uneven ground: whole on it, and over its edges on their way."""

import itertools
import math
import pickle
from functools import cache

import numpy as np
import pytest

from controller_node.references.steering import footsteps
from controller_node.references.steering.course import Footprint
from controller_node.references.steering.footholds import Footholds
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import ShapeType
from msgs_config.geometry import rotations
from tests.controller_node.references.steering.test_footsteps import FEET, HUMANOID, stands
from tests.controller_node.references.steering.test_reference import LASTING, RATE, make, steer

RISE, TREAD, EDGE = 0.15, 0.4, 1.5  # m; where the first step is
SLOPE = math.tan(math.radians(15.0))


class Stairs:
    """Steps along x, without an end."""

    def at(self, places: FloatArray) -> FloatArray:
        return RISE * np.maximum(np.floor((places[:, 0] - EDGE) / TREAD) + 1.0, 0.0)


class StairsDown:
    """Steps down along x, without an end."""

    def at(self, places: FloatArray) -> FloatArray:
        return -RISE * np.maximum(np.floor((places[:, 0] - EDGE) / TREAD) + 1.0, 0.0)


class Slope:
    """It rises along x and falls along y."""

    def at(self, places: FloatArray) -> FloatArray:
        return SLOPE * places[:, 0] - 0.1 * places[:, 1] + 0.2


class Island:
    """Ground for x below 1 alone."""

    def at(self, places: FloatArray) -> FloatArray:
        return np.where(places[:, 0] < 1.0, 0.0, np.nan)


class Points:
    """Nowhere even."""

    def at(self, places: FloatArray) -> FloatArray:
        return 0.05 * np.cos(100.0 * places[:, 0]) + 0.1


def test_a_foot_stays_where_the_ground_is_even() -> None:
    found = Footholds(HUMANOID, Stairs()).nearest(0, Footprint(0.5 + 0.1j, 0.3))

    assert found.place == pytest.approx(0.5 + 0.1j, abs=0.01)
    assert (found.height, found.slope) == (0.0, 0j)


@pytest.mark.parametrize("x", np.arange(1.2, 2.6, 0.03).tolist())
def test_a_foot_stands_whole_on_one_tread(x: float) -> None:
    found = Footholds(HUMANOID, Stairs()).nearest(1, Footprint(complex(x, -0.1), 0.0))

    step = round(found.height / RISE)
    begin = EDGE + (step - 1) * TREAD if step else -math.inf
    assert found.height == pytest.approx(RISE * step, abs=1e-9)
    assert abs(found.slope) < 1e-9
    assert begin + 0.05 < found.place.real < EDGE + step * TREAD - 0.05  # the ankle, well inside
    assert abs(found.place.real - x) < 0.25


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_a_foot_is_as_steep_as_a_slope(heading: float) -> None:
    found = Footholds(HUMANOID, Slope()).nearest(0, Footprint(2.0 + 1.0j, heading))

    assert found.slope == pytest.approx(complex(SLOPE, -0.1), abs=1e-6)
    x, y = found.place.real, found.place.imag
    assert found.height == pytest.approx(SLOPE * x - 0.1 * y + 0.2, abs=1e-6)


def test_a_foot_keeps_off_where_there_is_no_ground() -> None:
    found = Footholds(HUMANOID, Island()).nearest(0, Footprint(0.95 + 0j, 0.0))

    assert found.place.real < 0.9


def test_where_nothing_is_even_a_foot_stands_on_what_is_highest() -> None:
    found = Footholds(HUMANOID, Points()).nearest(0, Footprint(0j, 0.0))

    assert 0.1 < found.height <= 0.15
    assert found.slope == 0j


def test_footholds_are_the_same_once_they_were_kept() -> None:
    footholds = Footholds(HUMANOID, Stairs())
    found = footholds.nearest(0, Footprint(1.6 + 0j, 0.0))

    assert pickle.loads(pickle.dumps(footholds)).nearest(0, Footprint(1.6 + 0j, 0.0)) == found


def swing(target: Footprint) -> tuple[FloatArray, list[Footprint]]:
    """How much higher (50,) than its prints a foot is that swings from the origin, m, and those."""
    shares = np.linspace(0.0, 1.0, 50).tolist()
    feet = [Footprint(0j, 0.0, slope=target.slope)]
    for was, now in itertools.pairwise(shares):
        feet.append(footsteps.swung_on(feet[-1], target, was, now))
    lifts = [footsteps.clearance(*each) for each in zip(feet, [target] * 50, shares, strict=True)]
    return np.array(lifts), feet


@pytest.mark.parametrize("rise", [0.15, -0.15])
def test_a_swing_begins_and_ends_at_its_prints_and_is_above_the_line_between(rise: float) -> None:
    target = Footprint(0.7 + 0.1j, 0.3, rise)
    lifts, feet = swing(target)

    assert (lifts[0], lifts[-1]) == (0.0, 0.0)
    assert lifts[1:-1].min() > 0.0
    assert lifts.max() > 0.05
    assert feet[-1].place == pytest.approx(target.place)
    assert feet[-1].height == pytest.approx(rise)


def test_down_from_an_edge_a_foot_is_ahead_sooner_than_on_the_flat() -> None:
    down, flat = (swing(Footprint(0.7 + 0j, 0.0, rise))[1] for rise in (-0.15, 0.0))

    ahead = [here.place.real - there.place.real for here, there in zip(down, flat, strict=True)]
    assert min(ahead) >= 0.0
    assert max(ahead) > 0.1


@pytest.mark.parametrize("was", [1.0 - 1e-10, 1.0])
def test_a_foot_that_is_all_but_there_comes_down(was: float) -> None:
    foot, target = Footprint(0.7 + 0j, 0.0, -0.15), Footprint(0.7 + 0j, 0.0, -0.15)

    assert footsteps.swung_on(foot, target, was, 0.0) == target
    assert footsteps.clearance(foot, target, was) == 0.0


def test_along_a_slope_a_foot_goes_as_that_does() -> None:
    lifts, feet = swing(Footprint(0.7 + 0j, 0.0, -0.7 * SLOPE, -SLOPE + 0j))

    np.testing.assert_allclose(lifts, 0.0, atol=1e-12)
    for foot in feet:
        assert foot.height == pytest.approx(-SLOPE * foot.place.real, abs=1e-12)


@cache
def climbing() -> SteeredReference:
    return steer(make(**LASTING).over(Stairs()), VelocityCommand(0, 0.6, 0.0, 0.0))


def test_feet_stand_on_stairs_and_swing_over_their_edges() -> None:
    reference, model = climbing(), DynamicsModel(HUMANOID)
    deepest, highest = 0.0, 0.0
    for tick in range(RATE, 7 * RATE, 5):
        position = reference.sample(tick / RATE).configuration.position
        model.update(position, np.zeros(HUMANOID.layout.size))
        soles = lowest_heights(HUMANOID, model)[FEET]
        ankles = model.link_poses()[0][FEET]
        below = Stairs().at(ankles[:, :2])
        deepest = min(deepest, float((soles - below).min()))
        standing = np.array(stands(reference, tick))
        highest = max(highest, float(np.abs(soles - below)[standing].max(initial=0.0)))

    assert position[2] > 1.7  # six steps or more
    assert deepest > -0.05  # below the ankles
    assert highest < 0.06


CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


def corners_of(model: DynamicsModel, foot: int) -> FloatArray:
    """Corners (8, 3) of a foot's box in the world, m."""
    (box,) = HUMANOID.links[foot].collision_shapes
    assert box.type is ShapeType.BOX
    places, turns = model.link_poses()
    own = np.array(box.pose.position) + rotations.rotate(
        np.array(box.pose.orientation_xyzw), CORNERS * np.array(box.size)
    )
    return places[foot] + rotations.rotate(turns[foot], own)


@pytest.mark.parametrize("speed", [0.5, 0.6])
def test_heels_are_past_an_edge_before_they_sink_below_it(speed: float) -> None:
    reference = steer(make(**LASTING).over(StairsDown()), VelocityCommand(0, speed, 0.0, 0.0))
    model, deepest = DynamicsModel(HUMANOID), 0.0
    for tick in range(RATE, 7 * RATE, 2):
        position = reference.sample(tick / RATE).configuration.position
        model.update(position, np.zeros(HUMANOID.layout.size))
        for foot in FEET:
            corners = corners_of(model, foot)
            deepest = min(deepest, float((corners[:, 2] - StairsDown().at(corners)).min()))

    assert position[2] < 0.2  # five steps or more
    assert deepest > -0.02


@pytest.mark.parametrize("seed", range(4))
def test_feet_come_down_on_one_tread_whatever_is_commanded(seed: int) -> None:
    draw, reference = np.random.default_rng(seed), climbing()
    landings = 0
    for tick in range(0, 10 * RATE, RATE // 2):
        speed, turn = draw.uniform(0.2, 0.8), draw.uniform(-0.4, 0.4)
        reference = reference.steered(VelocityCommand(tick, speed, 0.0, turn), tick).reference
        for each in range(tick + 1, tick + RATE // 2 - 1):
            before, here, after = (reference.course(each + by).feet for by in (-1, 0, 1))
            for foot, was, will in zip(here, before, after, strict=True):
                if was == foot or foot != will:
                    continue  # it stands, or swings on
                step = round(foot.height / RISE)
                assert foot.height == pytest.approx(RISE * step, abs=1e-6)
                assert Stairs().at(np.array([[foot.place.real, 0.0]])) == pytest.approx(foot.height)
                landings += 1

    assert landings > 10


def test_who_stops_on_what_it_feels_has_both_feet_flat() -> None:
    high = steer(make(**LASTING).over(None), VelocityCommand(0, 0.6, 0.0, 0.0))
    model, soles = DynamicsModel(HUMANOID), []
    for stop in range(600, 880, 40):
        stopped = high.steered(VelocityCommand(stop, 0.0, 0.0, 0.0), stop).reference
        model.update(
            stopped.sample(stop / RATE + 6.0).configuration.position, np.zeros(HUMANOID.layout.size)
        )
        soles.append(lowest_heights(HUMANOID, model)[FEET])

    np.testing.assert_allclose(soles, 0.0, atol=0.004)


def test_it_begins_as_high_as_the_ground() -> None:
    class Block:
        def at(self, places: FloatArray) -> FloatArray:
            return np.full(len(places), 0.3)

    low, high = make(**LASTING), make(**LASTING).over(Block())

    rise = high.sample(0.0).configuration.position - low.sample(0.0).configuration.position
    assert rise[2] == pytest.approx(0.3)


@pytest.mark.parametrize("stop", [4.5, 4.7, 4.9])
def test_told_to_stop_on_stairs_it_comes_to_stand(stop: float) -> None:
    command = VelocityCommand(round(stop * RATE), 0.0, 0.0, 0.0)
    reference = climbing().steered(command, 4 * RATE).reference

    here, later = (reference.sample(each).configuration.position for each in (8.0, 9.1))

    np.testing.assert_allclose(here, later, atol=1e-6)
    assert here[2] > 1.2  # amid the stairs


def test_without_heights_nothing_is_another_one() -> None:
    class Flat:
        def at(self, places: FloatArray) -> FloatArray:
            return np.zeros(len(places))

    plain = steer(make(**LASTING), VelocityCommand(0, 0.6, 0.0, 0.3))
    flat = steer(make(**LASTING).over(Flat()), VelocityCommand(0, 0.6, 0.0, 0.3))

    for tick in range(0, 4 * RATE, 30):
        here, there = (each.sample(tick / RATE).configuration.position for each in (plain, flat))
        np.testing.assert_allclose(here, there, atol=0.05)  # prints are on a grid
