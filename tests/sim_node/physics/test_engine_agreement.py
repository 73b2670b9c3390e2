"""The simulator's engine and the controller's model are the same mechanics.

They were written by different people, so that what they agree on is hardly wrong: frames, inertia,
the order of the joints, gravity, Coriolis forces, and what an effort means.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.balls.sphere_sweep import find_impact
from sim_node.physics.passive_forces import PassiveForces
from sim_node.physics.settings import WorldSettings
from tests.support.physics import (
    EVERY_CHARACTER,
    INSTANT,
    LoneWorld,
    acceleration,
    character,
    character_id,
    free_random_state,
    kinetic_energy,
    link_poses,
    without_self_collision,
)

pytestmark = pytest.mark.usefixtures("engine")
MARGIN = 2.5e-3  # m: Bullet's round convex hulls of meshes, seen aslant

STATES = 100
ROUNDING = 1e-12
"""Of poses and energies of order one, which need no difference quotient."""

every_character = pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)


def random_scenes(name: str) -> Iterator[tuple[LoneWorld, DynamicsModel, np.random.Generator]]:
    """Both engines in the same random states without contact."""
    whole = without_self_collision(name)
    model = DynamicsModel(whole)
    rng = np.random.default_rng(1)
    with LoneWorld(whole, WorldSettings(step_s=INSTANT)) as world:
        for _ in range(STATES):
            position, velocity = free_random_state(world.body, whole, rng)
            model.update(position, velocity)
            yield world, model, rng


def damping(
    whole: Character, world: LoneWorld, gravity: float = 9.81, known: FloatArray | None = None
) -> FloatArray:
    """What passive damping adds in the simulator; the model knows no soft limits.

    `known` (n,) is the effort beside it.
    """
    links = tuple(replace(link, joint=replace(link.joint, soft_limit=None)) for link in whole.links)
    position, velocity = world.body.read()
    passive = PassiveForces(replace(whole, links=links), INSTANT, gravity)
    beside = np.zeros(whole.layout.size) if known is None else known
    return passive.effort(position, velocity, beside)


@every_character
def test_both_engines_put_every_link_frame_in_the_same_pose(name: str) -> None:
    whole = without_self_collision(name)
    for world, model, _ in random_scenes(name):
        origins, turns = link_poses(world.body, whole)
        model_origins, model_turns = model.link_poses()

        np.testing.assert_allclose(model_origins, origins, rtol=0.0, atol=10.0 * ROUNDING)
        assert rotations.angle_between(model_turns, turns).max() < 10.0 * ROUNDING


@every_character
def test_both_engines_find_the_same_kinetic_energy(name: str) -> None:
    whole = without_self_collision(name)
    for world, model, _ in random_scenes(name):
        assert model.kinetic_energy() == pytest.approx(
            kinetic_energy(world.body, whole), rel=ROUNDING, abs=ROUNDING
        )


@pytest.mark.slow
@every_character
def test_both_engines_accelerate_alike_under_efforts_on_every_degree_of_freedom(name: str) -> None:
    whole = without_self_collision(name)
    for world, model, rng in random_scenes(name):
        mass_matrix, bias = model.mass_matrix(), model.bias_force()
        effort = rng.uniform(-20.0, 20.0, len(bias))

        measured = acceleration(world, effort + damping(whole, world, known=effort))

        # at the velocity that the instant ends with
        implicit = mass_matrix + INSTANT * np.diag(whole.passive_damping())
        predicted = np.linalg.solve(implicit, effort - bias)
        assert np.abs(measured - predicted).max() < 1e-6 * np.abs(predicted).max()
        # a heavy base accelerates little: weighed by the masses its part counts too, and so does
        # that its origin, off the centre of mass, turns during the step
        force = implicit @ measured
        assert np.abs(force - (effort - bias)).max() < 1e-5 * np.abs(effort - bias).max()


def test_links_without_inertia_are_point_masses_to_both(tmp_path: Path) -> None:
    """As in the quadruped that the engine ships; files with impossible inertia become so too."""
    urdf = "package://pybullet_data/laikago/laikago_toes.urdf"
    (tmp_path / "laikago.yaml").write_text(f"urdf: {urdf}\ninertia: file\n")
    for world, model, rng in random_scenes(str(tmp_path / "laikago.yaml")):
        effort = rng.uniform(-20.0, 20.0, len(model.bias_force()))

        measured = acceleration(world, effort)

        predicted = np.linalg.solve(model.mass_matrix(), effort - model.bias_force())
        assert np.abs(measured - predicted).max() < 1e-6 * np.abs(predicted).max()


@every_character
def test_both_engines_weigh_the_character_alike_under_another_gravity(name: str) -> None:
    whole = without_self_collision(name)
    model = DynamicsModel(whole, gravity=1.62)
    rng = np.random.default_rng(2)
    with LoneWorld(whole, WorldSettings(step_s=INSTANT, gravity=1.62)) as world:
        position, velocity = free_random_state(world.body, whole, rng)
        model.update(position, velocity)

        measured = acceleration(world, damping(whole, world, 1.62))

    implicit = model.mass_matrix() + INSTANT * np.diag(whole.passive_damping())
    predicted = np.linalg.solve(implicit, -model.bias_force())
    assert np.abs(measured - predicted).max() <= 1e-6 * np.abs(predicted).max()


@pytest.mark.parametrize("engine", ["bullet"], indirect=True)
@pytest.mark.parametrize(
    ("name", "link"), [("humanoid", "chest"), ("humanoid", "left_wrist"), ("laikago", "chassis")]
)
@pytest.mark.parametrize("origin", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.8, 0.0)])
@pytest.mark.parametrize(
    "thrown",
    [
        ProjectileThrow(1.0, 0.1, (0.0,) * 3, (0.0,) * 3),
        ProjectileThrow(1.0, None, (0.0,) * 3, (0.0,) * 3, (0.3, 0.1, 0.2), 0.4),
    ],
    ids=["ball", "box"],
)
def test_the_engines_agree_where_what_is_thrown_meets_a_link(
    name: str, link: str, origin: tuple[float, float, float], thrown: ProjectileThrow
) -> None:
    whole = character(name)
    rest, way = np.array(whole.rest_position), np.array(origin)

    one, other = (
        find_impact(whole, rest, link, way, thrown, distance=2.0, engine=engine)
        for engine in ("bullet", "mujoco")
    )

    np.testing.assert_allclose(one.target, other.target, atol=1e-9)
    np.testing.assert_allclose(one.centre, other.centre, atol=MARGIN)
