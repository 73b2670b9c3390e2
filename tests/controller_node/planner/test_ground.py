"""The planner on ground that is no plane: what it knows and feels of it, and what it refuses."""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

from actuated_characters.metrics.falls import FallWatch, PostureReader
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.velocities import plan_velocities
from controller_node.ground import FELT, TERRAIN
from controller_node.parameters import check_world, make_controller, resolve_for
from controller_node.planner.anchor import Anchor
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.felt_ground import FeltGround
from msgs_config.character.dynamics import still_model
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Pose, Shape, ShapeType
from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from msgs_config.messages.state import StampedState
from sim_node.simulation_factory import make_simulation_settings
from tests.support.physics import character

HUMANOID = character("humanoid")
REST = np.array(HUMANOID.rest_position)
FEET = [HUMANOID.links[each].name for each in HUMANOID.end_effectors]
FEET = [name for name in FEET if name in HUMANOID.feet]
BLOCK = Shape(ShapeType.BOX, (4.0, 4.0, 0.5), Pose((0.0, 0.0, 0.05)))  # up to 0.3 m
STEPS = "stairs: [{at: [1.0, 0], steps: 2, rise: 0.15, tread: 0.4, landing: 3}]"


def model(**given: object) -> ContactModel:
    return ContactModel(HUMANOID, period_s=1 / 240, gravity=9.81, friction=0.45, **given)  # type: ignore[arg-type]


def touching(found: ContactModel, height: float) -> mujoco.MjData:
    """The model at rest, its soles at a height in m."""
    data = mujoco.MjData(found.model)
    lowest = lowest_heights(HUMANOID, still_model(HUMANOID, REST)).min()
    data.qpos[:] = found.position_of(REST)
    data.qpos[2] += height - lowest
    mujoco.mj_forward(found.model, data)
    return data


def test_the_model_touches_the_shapes_that_it_knows() -> None:
    plain, known = model(), model(terrain=[BLOCK])

    on_block, through = touching(known, 0.299), touching(plain, 0.299)
    on_plane = touching(plain, -0.001)

    assert through.ncon == 0
    assert on_block.ncon == on_plane.ncon > 0
    np.testing.assert_allclose(on_block.contact.dist, -0.001, atol=1e-9)
    for name in ("solref", "friction", "dim"):
        np.testing.assert_array_equal(
            getattr(on_block.contact, name), getattr(on_plane.contact, name)
        )


def test_each_foot_has_its_own_plane_where_it_feels_the_ground() -> None:
    felt = model(plane_each=True)
    felt.put_planes(np.array([0.05, 0.0]))

    data = touching(felt, 0.049)

    links = {felt.model.geom_bodyid[pair].max() - 1 for pair in data.contact.geom}
    assert [HUMANOID.links[each].name for each in links] == FEET[:1]


def test_soles_that_carry_are_as_high_as_the_lowest_point_of_a_foot() -> None:
    draw = np.random.default_rng(3)
    position = REST + 0.2 * draw.normal(size=HUMANOID.layout.size)
    contacts = np.zeros((len(HUMANOID.links), 6))
    names = [link.name for link in HUMANOID.links]
    contacts[names.index(FEET[1]), 2] = 100.0
    found = model(plane_each=True)

    soles = found.soles(found.position_of(position), contacts)

    lowest = lowest_heights(HUMANOID, still_model(HUMANOID, position))
    assert np.isnan(soles[0])
    assert soles[1] == pytest.approx(lowest[names.index(FEET[1])], abs=1e-9)


def test_a_foot_that_swings_is_to_come_down_as_high_as_the_other_one_stands() -> None:
    ground = FeltGround()
    seen = [(0.001, -0.002), (0.0, np.nan), (0.0, 0.05), (np.nan, 0.051), (0.098, np.nan)]

    found = []
    for soles in seen:
        ground = ground.after(np.array(soles))
        found.append(ground.heights)

    assert found == [(0.0, 0.0), (0.0, 0.0), (0.0, 0.05), (0.05, 0.05), (0.098, 0.098)]
    assert ground.level == 0.098


def test_in_the_air_the_ground_stays_as_it_was() -> None:
    ground = FeltGround((0.1, 0.2))

    assert ground.after(np.array([np.nan, np.nan])) == ground
    assert ground.level == pytest.approx(0.15)
    np.testing.assert_allclose(ground.planes, [-0.05, 0.05])


def test_the_references_world_is_as_high_as_the_ground_that_is_felt() -> None:
    anchor, found = Anchor(ground=FeltGround((0.1, 0.2))), model()
    position, velocity = found.position_of(REST), np.zeros(HUMANOID.layout.size)

    seen, _ = anchor.to_reference_world(position, velocity)

    assert seen[2] == pytest.approx(position[2] - 0.15)
    np.testing.assert_allclose(anchor.to_world(np.array([seen[:3]])), [position[:3]], atol=1e-12)


@pytest.mark.parametrize(
    ("planner", "own", "simulated", "sentence"),
    [
        ("predictive", "plane", "plane", ""),
        ("predictive", "a.yaml", "a.yaml", ""),
        ("predictive", "felt", "a.yaml", ""),
        ("predictive", "felt", "plane", ""),
        ("predictive", "plane", "a.yaml", "'terrain' is plane, but sim_node's is a.yaml; it must"),
        ("predictive", "a.yaml", "plane", "'terrain' is a.yaml, but sim_node's is plane; it must"),
        ("predictive", "plane", "none", "knows the ground at z = 0 alone"),
        ("policy", "plane", "a.yaml", "knows the ground at z = 0 alone"),
    ],
)
def test_a_planner_knows_the_ground_or_says_that_it_does_not(
    planner: str, own: str, simulated: str, sentence: str
) -> None:
    values = resolve_for(HUMANOID, {"planner": planner, "terrain": own})

    if not sentence:
        check_world(values, {"terrain": simulated})
        return
    with pytest.raises(ConfigurationError, match=sentence):
        check_world(values, {"terrain": simulated})


def walk(folder: Path, seconds: float, **controller: object) -> RunPlan:
    """A planned walk ahead over two steps."""
    (folder / "steps.yaml").write_text(STEPS)
    plan = make_plan(
        "humanoid",
        seconds,
        {"reference": "steered"},
        {"terrain": str(folder / "steps.yaml")},
        {"planner": "predictive", "plan.workers": 1, "plan.step": 0.009, **controller},
    )
    return plan_velocities(plan, "0.6,0,0@0.2")[0]


def test_a_run_tells_its_planner_of_the_terrain_unless_it_is_to_feel_it(tmp_path: Path) -> None:
    assert walk(tmp_path, 1.0).controller[TERRAIN.name] == str(tmp_path / "steps.yaml")
    assert walk(tmp_path, 1.0, terrain=FELT).controller[TERRAIN.name] == FELT
    with pytest.raises(ConfigurationError, match="to be blind to it"):
        walk(tmp_path, 1.0, terrain="plane")


def test_who_knows_the_terrain_is_where_it_is() -> None:
    given: Mapping[str, object] = {"placement": [1.0, 0.0, 0.0, 0.0], "planner": "predictive"}

    with pytest.raises(ConfigurationError, match="'placement' is not 0"):
        make_plan(
            "humanoid",
            1.0,
            {"reference": "steered"},
            {"terrain": "stairs"},
            given,
        )


def test_what_is_felt_needs_contacts() -> None:
    values = resolve_for(HUMANOID, {"planner": "predictive", "terrain": FELT})
    plan = make_plan("humanoid", 0.1, {"reference": "hold"}, {}, {})
    controller = make_controller(HUMANOID, plan.reference, values)

    assert controller.needs_contacts
    with pytest.raises(ConfigurationError, match="needs the contacts of each"):
        controller.compute_effort(StampedState(0, REST, np.zeros(len(REST)), None), 0)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (
            {"planner": "hybrid", "terrain": FELT},
            "knows the ground at z = 0 alone; it must be plane",
        ),
        ({"terrain": "a.yaml"}, "a.yaml: No such file"),
        ({"planner": "policy", "terrain": "stairs"}, "z = 0 alone; it must be plane"),
        ({"terrain": FELT, "command_delay_ticks": 1}, "'command_delay_ticks' is 1; it must be 0"),
        ({"terrain": FELT, "plan.contact": "world"}, "'plan.contact' is world; it must be own"),
        (
            {"terrain": "flet"},
            "unknown terrain 'flet'; did you mean 'felt'\\? there are: plane, felt, rubble, slope",
        ),
    ],
)
def test_what_cannot_be_is_refused(given: Mapping[str, object], sentence: str) -> None:
    controller = {"planner": "predictive", **given}

    with pytest.raises(ActuatedCharactersError, match=sentence):
        make_plan("humanoid", 1.0, {"reference": "steered"}, {}, controller)


def test_who_has_no_feet_feels_no_ground() -> None:
    given = {"planner": "predictive", "terrain": FELT}

    with pytest.raises(ConfigurationError, match="'laikago' has no feet in its file"):
        make_plan("laikago", 1.0, {"reference": "clip", "clip": "walk"}, {}, given)


def arrives(plan: RunPlan) -> float:
    """How far a walk gets, m, which must not fall."""
    terrain = make_simulation_settings(plan.simulator).world.terrain
    watch = FallWatch(PostureReader(HUMANOID, terrain), 240.0)
    for tick in ticks_in_process(plan):
        position = tick.following.position
        assert not watch.has_fallen(position)
    return float(position[0])


@pytest.mark.nightly
@pytest.mark.slow
def test_it_walks_over_a_plate_that_it_feels(tmp_path: Path) -> None:
    (tmp_path / "plate.yaml").write_text("boxes: [{at: [1.5, 0], size: [0.8, 4, 0.05]}]")
    plan = make_plan(
        "humanoid",
        5.5,
        {"reference": "steered"},
        {"terrain": str(tmp_path / "plate.yaml")},
        {"planner": "predictive", "plan.workers": 1, "plan.step": 0.009, "terrain": FELT},
    )

    assert arrives(plan_velocities(plan, "0.5,0,0@0.2")[0]) > 2.2


@pytest.mark.slow
def test_it_walks_up_steps_that_it_knows(tmp_path: Path) -> None:
    assert arrives(walk(tmp_path, 5.5)) > 2.4
