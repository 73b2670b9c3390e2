"""The ground holds what stands on it."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from benchmarks.tables.ground import depths_below_ground
from msgs_config.clips.reading import available_clips
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.settings import STEADY_CONTACTS, WorldSettings
from tests.support.engines import pybullet
from tests.support.physics import LoneWorld, advance, box_character, character

pytestmark = pytest.mark.usefixtures("engine")

MEAN_DEPTH, MOST_DEPTH = 3e-3, 15e-3  # m, beyond the reference's own
CLIPS = [
    (name, clip) for name in ("humanoid", "laikago") for clip in available_clips(character(name))
]
EVERY = 4  # ticks; that a lowest point is found takes longer than a step
SUDDEN = 30.0  # rad/s by which a joint's speed changes in a tick


@pytest.mark.parametrize(("name", "clip"), CLIPS)
def test_no_clip_sinks_into_the_ground(name: str, clip: str) -> None:
    plan = make_plan(name, 4.0, {"reference": "clip", "clip": clip}, {}, {})
    ticks = [(tick.state, tick.reference) for tick in ticks_in_process(plan)][::EVERY]
    own, wanted = (
        depths_below_ground(plan.character, np.array([each[column].position for each in ticks]))
        for column in (0, 1)
    )

    assert own.mean() < wanted.mean() + MEAN_DEPTH
    assert own.max() < wanted.max() + MOST_DEPTH


def trembling(name: str, **settings: object) -> float:
    """Share of the ticks of a walk in which an ankle's speed changes at once."""
    plan = make_plan(name, 2.0, {"reference": "clip", "clip": "walk"}, settings, {})
    ankles = [joint.entries for joint in plan.character.layout.joints if "ankle" in joint.name]
    speeds = [
        np.concatenate([tick.following.velocity[entries] for entries in ankles])
        for tick in ticks_in_process(plan)
    ]
    return float(np.mean(np.abs(np.diff(speeds, axis=0)).max(axis=1) > SUDDEN))


def test_a_loaded_sole_does_not_tip_to_and_fro() -> None:
    assert trembling("humanoid") < 0.01


def mesh_soled_humanoid(folder: Path) -> str:
    """The humanoid's file in a folder, its soles meshes that are no other than the boxes were."""
    whole = character("humanoid")
    corners = [(x, y, z) for x in (-0.354, 0.354) for y in (-0.11, 0.11) for z in (-0.18, 0.18)]
    sides = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in sides]
    (folder / "sole.obj").write_text("\n".join(lines) + "\n")
    urdf = whole.loading.urdf_path.read_text()
    box = '<box size="0.708000 0.220000 0.360000" />'
    assert urdf.count(box) == 2
    (folder / "humanoid.urdf").write_text(urdf.replace(box, '<mesh filename="sole.obj"/>'))
    content = yaml.safe_load(whole.file.read_text("utf-8")) | {"urdf": "humanoid.urdf"}
    del content["feet"]  # balance wants boxes
    file = folder / "mesh_soled.yaml"
    file.write_text(yaml.safe_dump(content), "utf-8")
    return str(file)


@pytest.mark.parametrize("engine", ["bullet"], indirect=True)
def test_a_sole_that_is_a_mesh_trembles_only_where_contacts_lose_their_points(
    tmp_path: Path,
) -> None:
    name = mesh_soled_humanoid(tmp_path)

    engines_own, steady = trembling(name), trembling(name, **STEADY_CONTACTS)

    assert engines_own > 0.02
    assert steady < engines_own / 3.0


@pytest.mark.parametrize("engine", ["bullet"], indirect=True)
def test_each_link_and_ball_touches_one_of_bullets_two_grounds() -> None:
    humanoid = character("humanoid")
    still = np.zeros(humanoid.layout.size)
    lying = np.array(humanoid.rest_position)
    lying[2] = 0.0
    with LoneWorld(humanoid, WorldSettings()) as world:
        world.balls.add(ProjectileThrow(1.0, 0.2, (3.0, 0.0, 0.1), (0.0, 0.0, 0.0)))
        world.body.set_state(lying, still)
        advance(world, still)
        points = pybullet.getContactPoints(physicsClientId=world._client)
        balls, body = world.balls.numbers, world.body._body
        names = dict(zip(world.body._numbers, (link.name for link in humanoid.links), strict=True))
    touched: dict[str, set[int]] = {}
    for _, one, other, link_of_one, link_of_other, *_ in points:
        ground, number, link = min((one, other, link_of_other), (other, one, link_of_one))
        if ground < body:
            touched.setdefault("ball" if number in balls else names[link], set()).add(ground)

    assert {"ball", "right_ankle", "left_ankle", "right_wrist", "right_knee"} < set(touched)
    assert all(len(grounds) == 1 for grounds in touched.values())
    assert touched["right_ankle"] == touched["left_ankle"]
    assert all(each != touched["left_ankle"] for name, each in touched.items() if "ank" not in name)


@pytest.mark.parametrize("away", [0.0, 1e5])
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_a_box_lies_on_the_ground_wherever_and_however_fast_it_lands(
    tmp_path: Path, away: float, speed: float
) -> None:
    box = box_character(tmp_path, "0.4 0.4 0.2")
    with LoneWorld(box, WorldSettings()) as world:
        start = np.array([away, -away, 0.1 + speed / 100.0, 0.0, 0.0, 0.0])
        world.body.set_state(start, np.array([0.0, 0.0, -speed, 0.0, 0.0, 0.0]))
        advance(world, np.zeros(6), 480)
        position, velocity = world.body.read()
        (force,), _ = world.body.contact_wrenches()

    assert position[2:5] == pytest.approx([0.1, 0.0, 0.0], abs=2e-3)
    assert np.abs(velocity).max() < 1e-3
    assert force[2] == pytest.approx(2.0 * 9.81, rel=1e-3)
