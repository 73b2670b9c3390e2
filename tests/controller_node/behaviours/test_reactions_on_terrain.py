"""Reactions on ground that is no plane: what it does is no hit, and they get up on it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned.wrenches import plan_push
from controller_node.behaviours.base import Mode, Phase
from controller_node.behaviours.factory import choose_behaviour
from controller_node.behaviours.hit_detection import HitDetector
from controller_node.ground import Terrain
from controller_node.parameters import check_world, make_controller, resolve_for
from controller_node.references.clip import ClipReference
from controller_node.references.posture import Posture
from controller_node.references.transformed import PlanarTransform
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel, still_model
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Placement, Pose, Shape, ShapeType
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ConfigurationError
from msgs_config.terrain.surfaces import Surfaces
from tests.support.physics import character

HUMANOID = character("humanoid")
LINKS = [link.name for link in HUMANOID.links]
STANDING = np.array(HUMANOID.rest_position)
PERIOD = 1.0 / 240.0  # s
FLOOR = Shape(ShapeType.BOX, (9.0, 9.0, 1.0), Pose((0.0, 0.0, -0.5)))
PLATE = 0.15  # m, higher than the ground beside the way
DEPTH = -0.8  # m, of the ground beside another way
PIT = """
ground: none
boxes: [{at: [5, -1.6, -1.0], size: [16, 4, 1]}, {at: [5, 4.4, -1.8], size: [16, 8, 1]}]
"""
BESIDE = f"boxes: [{{at: [5, 1.75], size: [14, 3, {PLATE}]}}]"


def ahead_of_toes() -> float:
    """x in m of a wall's face that toes touch, as the humanoid stands."""
    model = still_model(HUMANOID, STANDING)
    foot = LINKS.index(HUMANOID.feet[0])
    (box,) = HUMANOID.links[foot].collision_shapes
    assert box.type is ShapeType.BOX
    return float(model.link_poses()[0][foot, 0] + box.pose.position[0] + 0.5 * box.size[0]) + 0.01


def wall(x: float) -> Shape:
    return Shape(ShapeType.BOX, (1.0, 9.0, 0.4), Pose((x + 0.5, 0.0, 0.2)))


def impulse(
    terrain: Sequence[Shape], position: FloatArray = STANDING, **forces: tuple[float, float, float]
) -> float:
    """What is taken for a hit's impulse of forces on links that last a tick, N s."""
    model = DynamicsModel(HUMANOID)
    model.update(position, np.zeros(HUMANOID.layout.size))
    contacts = np.zeros((len(LINKS), 6))
    for name, force in forces.items():
        contacts[LINKS.index(name), :3] = force
    surfaces = Surfaces(HUMANOID, terrain) if terrain else None
    detector = HitDetector(HUMANOID, PERIOD, terrain=surfaces)
    hit = detector.strongest(contacts, *model.link_poses())
    return 0.0 if hit is None else hit.impulse


@pytest.mark.parametrize("seed", range(20))
def test_a_floor_explains_what_the_plane_does(seed: int) -> None:
    x, y, z = np.random.default_rng(seed).normal(0.0, 500.0, 3).tolist()

    floor, plane = (impulse(each, right_ankle=(x, y, z)) for each in ([FLOOR], []))

    assert floor == pytest.approx(plane, abs=1e-9)


def test_who_stands_on_a_block_touches_its_ground() -> None:
    block = Shape(ShapeType.BOX, (9.0, 9.0, 1.0), Pose((0.0, 0.0, -0.2)))  # up to 0.3 m
    high = STANDING.copy()
    high[2] += 0.3

    assert impulse([block], high, right_ankle=(100.0, 0.0, 450.0)) == 0.0
    assert impulse([], high, right_ankle=(100.0, 0.0, 450.0)) > 1.0


def test_a_wall_that_toes_run_into_is_no_hit() -> None:
    at_toes = [FLOOR, wall(ahead_of_toes())]
    farther = [FLOOR, wall(ahead_of_toes() + 0.1)]
    back, down = (-2400.0, 0.0, 300.0), (2400.0, 0.0, 300.0)

    assert impulse(at_toes, right_ankle=back) == pytest.approx(0.0, abs=1e-6)
    assert impulse(farther, right_ankle=back) > 5.0
    assert impulse(at_toes, right_ankle=down) > 5.0  # into the wall: that draws it does not


def test_of_two_surfaces_each_takes_its_share() -> None:
    # Up and back by the same, and by what friction on both allows besides: a sum in their cones.
    both = (-1000.0, 800.0, 1000.0)

    assert impulse([FLOOR, wall(ahead_of_toes())], right_ankle=both) == pytest.approx(0.0, abs=0.05)
    assert impulse([FLOOR], right_ankle=both) > 1.0


def test_a_slope_pushes_away_from_itself() -> None:
    angle = math.radians(30.0)
    turn = (0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle))  # falls along x
    soles = lowest_heights(HUMANOID, still_model(HUMANOID, STANDING)).min()
    below = 0.5 / math.cos(angle)
    slope = Shape(ShapeType.BOX, (9.0, 9.0, 1.0), Pose((0.0, 0.0, float(soles) - below), turn))
    steep = math.atan(0.9) + 0.9 * angle  # from upright: out of the plane's cone, in the slope's
    force = (1000.0 * math.sin(steep), 0.0, 1000.0 * math.cos(steep))

    assert impulse([slope], right_ankle=force) == pytest.approx(0.0, abs=1e-6)
    assert impulse([FLOOR], right_ankle=force) > 0.5


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate beside the way."""
    path = tmp_path_factory.mktemp("terrain") / "beside.yaml"
    path.write_text(BESIDE)
    return path


@dataclass
class Walked:
    """What became of a walk."""

    modes: list[Phase]
    root: FloatArray  # (t, 3) m


def walk(terrain: Path, force: float) -> Walked:
    """An active ragdoll walks for 9 s, pushed to the left after one, by a force in N."""
    simulator, given = {"terrain": str(terrain)}, {"behaviour": "active_ragdoll"}
    plan = make_plan("humanoid", 9.0, {"clip": "walk"}, simulator, given)
    assert plan.controller["terrain"] == str(terrain)
    controller = make_controller(plan.character, plan.reference, plan.controller)
    push = plan_push(plan, "chest", (0.0, force, 0.0), 1.0)
    modes, root = list[Phase](), list[FloatArray]()
    for tick in ticks_in_process(plan, [push], controller=controller):
        assert controller.mode is not None
        if not modes or controller.mode.phase is not modes[-1]:
            modes.append(controller.mode.phase)
        root.append(tick.following.position[:3])
    assert all(phase.facts.get("why") != "hit" for phase in modes)  # a push touches nothing
    return Walked(modes, np.array(root))


@pytest.mark.slow
def test_who_is_pushed_onto_a_plate_walks_on_there(beside: Path) -> None:
    walked = walk(beside, 1000.0)

    assert [phase.mode for phase in walked.modes] == [Mode.TRACK]
    assert walked.root[-1, 1] > 1.0
    assert walked.root[-240:, 2].min() > PLATE + 0.75


@pytest.mark.slow
def test_who_falls_onto_a_plate_gets_up_there_and_walks_off_it(beside: Path) -> None:
    walked = walk(beside, 2500.0)

    modes = [phase.mode for phase in walked.modes]
    assert Mode.LIMP in modes
    assert modes[-1] is Mode.TRACK
    assert PLATE < walked.root[:, 2].min() < PLATE + 0.2  # it lay there
    assert walked.root[:, 2].max() > PLATE + 0.85  # and stood
    assert walked.root[-1, 1] < 0.0
    assert 0.75 < walked.root[-1, 2] < 0.9


@pytest.mark.slow
def test_who_falls_into_a_pit_gets_up_by_the_clip_that_is_near(tmp_path: Path) -> None:
    terrain = tmp_path / "pit.yaml"
    terrain.write_text(PIT)

    walked = walk(terrain, 1000.0)

    (found,) = (phase for phase in walked.modes if "distance" in phase.facts)
    assert float(str(found.facts["distance"])) < 1.0
    assert walked.modes[-1].mode is Mode.TRACK
    assert walked.root[-120:, 2].min() > DEPTH + 0.75


def test_a_roof_is_no_ground_to_who_is_below_it() -> None:
    roof = Shape(ShapeType.BOX, (9.0, 9.0, 0.1), Pose((0.0, 0.0, 2.5)))
    terrain = Terrain(HUMANOID, [FLOOR, roof])

    assert terrain.height_below(np.array((0.0, 0.0, 0.9))) == pytest.approx(0.0, abs=1e-9)
    assert terrain.height_below(np.array((0.0, 0.0, 3.0))) == pytest.approx(2.55)
    assert terrain.height_below(np.array((99.0, 0.0, 3.0))) == 0.0  # where is none


def test_a_fall_is_seen_from_the_ground() -> None:
    posture, layout = Posture(HUMANOID), HUMANOID.layout
    low, high = STANDING.copy(), STANDING.copy()
    low[2], high[2] = 2.3, 2.85
    body, target = layout.configuration(low), layout.configuration(high)

    assert posture.has_fallen(body, target, ground=2.0)
    assert not posture.has_fallen(body, target)


@pytest.mark.parametrize("behaviour", ["active_ragdoll", "reactive"])
def test_who_reacts_knows_the_ground_that_there_is(behaviour: str, beside: Path) -> None:
    plain = resolve_for(HUMANOID, {"behaviour": behaviour})
    known = resolve_for(HUMANOID, {"behaviour": behaviour, "terrain": str(beside)})

    check_world(known, {"terrain": str(beside)})
    check_world(plain, {"terrain": "none"})
    for values, terrain in ((plain, str(beside)), (known, "plane")):
        with pytest.raises(ConfigurationError, match=r"but sim_node's is .*; it must be the same"):
            check_world(values, {"terrain": terrain})


def test_who_reacts_cannot_be_blind_to_the_ground() -> None:
    blind = {"behaviour": "reactive", "terrain": "felt"}

    with pytest.raises(ConfigurationError, match="'terrain' is felt; a behaviour that reacts"):
        plan = make_plan("humanoid", 1.0, {"clip": "walk"}, {}, blind)
        make_controller(plan.character, plan.reference, plan.controller)


def test_who_reacts_may_begin_elsewhere_but_not_higher(beside: Path) -> None:
    values = resolve_for(HUMANOID, {"behaviour": "active_ragdoll", "terrain": str(beside)})

    choose_behaviour(HUMANOID.placed(Placement(1.0, -2.0, 0.0, 0.5)), values)
    with pytest.raises(ConfigurationError, match="'placement' is not at z = 0"):
        choose_behaviour(HUMANOID.placed(Placement(z=0.5)), values)


def test_a_reference_that_is_steered_over_terrain_is_not_carried(beside: Path) -> None:
    simulator, controller = {"terrain": str(beside)}, {"behaviour": "active_ragdoll"}

    with pytest.raises(ConfigurationError, match="is active_ragdoll, which carries a reference"):
        make_plan("humanoid", 1.0, {"reference": "steered"}, simulator, controller)


def test_a_move_lifts() -> None:
    here = ClipReference(HUMANOID.layout, read_clip(HUMANOID, "walk")).sample(0.4)

    lifted = PlanarTransform(0.3, 1.0, -2.0, 0.25).moved(HUMANOID.layout, here)
    level = PlanarTransform(0.3, 1.0, -2.0).moved(HUMANOID.layout, here)

    rise = lifted.configuration.position - level.configuration.position
    np.testing.assert_array_equal(np.flatnonzero(rise), [2])
    assert rise[2] == pytest.approx(0.25)
