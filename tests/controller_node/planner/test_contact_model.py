"""What rollouts are made of, against the product's own law and limits, and against numpy."""

from typing import Any

import mujoco
import numpy as np
import pytest

from controller_node.control_laws import GainArrays, stable_pd_effort
from controller_node.parameters import make_controller_settings, resolve_for
from controller_node.planner.compiled.draws import normal_draws
from controller_node.planner.compiled.rollout import Desired, RolloutModel, let_act
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.search.rollout_pool import RolloutPool
from controller_node.references.base import ReferenceState
from controller_node.references.clip import ClipReference
from controller_node.references.offsets import Offsets
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel, still_model
from msgs_config.clips.reading import read_clip
from msgs_config.compiled import linear, mass_matrix, soft_limits
from msgs_config.geometry import rotations
from msgs_config.messages.state import StampedState
from sim_node.physics.passive_forces import PassiveForces
from tests.support.physics import character, simulation

RATE = 240
PERIOD = 1.0 / RATE
HORIZON, KNOTS, CHECKS = 144, 36, 12  # ticks
OTHER_KEYS = [((6, 3), (0, 12)), ((5, 4), (0, 12)), ((5, 3), (1, 12)), ((5, 3), (0, 13))]
HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
N = LAYOUT.size
MODEL = ContactModel(HUMANOID, period_s=PERIOD, gravity=9.81, friction=0.45)


def gains(**given: object) -> GainArrays:
    """The humanoid's gains with a planner."""
    named = {"planner": "predictive", **given}
    values = resolve_for(HUMANOID, named)
    return make_controller_settings(HUMANOID, values).gains


def clip(name: str) -> ClipReference:
    """A clip of the humanoid."""
    return ClipReference(LAYOUT, read_clip(HUMANOID, name))


def desired(reference: ClipReference, tick: int) -> tuple[Desired, list[ReferenceState]]:
    """The reference over a horizon."""
    states = [reference.sample((tick + each) / RATE) for each in range(HORIZON + 1)]
    positions = [MODEL.position_of(state.configuration.position) for state in states]
    velocities = [state.velocity for state in states]
    course = Desired(
        tick, 1, KNOTS, tick // KNOTS, CHECKS, np.array(positions), np.array(velocities)
    )
    return course, states


class PlainRollout:
    """A rollout in plain Python: MuJoCo's steps, the controller's law, the simulator's limits."""

    def __init__(self, used: GainArrays) -> None:
        self.gains = used
        self.data = mujoco.MjData(MODEL._model)
        self.passive = PassiveForces(HUMANOID, PERIOD, 9.81)
        self.law_model = DynamicsModel(HUMANOID)

    def positions(
        self, start: FloatArray, velocity: FloatArray, plan: FloatArray, course: Desired
    ) -> tuple[list[FloatArray], list[FloatArray]]:
        """Positions (q,) and velocities (n,) after each tick."""
        model, data = MODEL._model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = MODEL.position_of(start), velocity
        positions, velocities = [], []
        for tick in range(HORIZON):
            mujoco.mj_step1(model, data)
            knot, share = divmod((course.first_tick + tick) / KNOTS - course.first_knot, 1.0)
            before, after = plan[int(knot)], plan[int(knot) + 1]
            offset = np.concatenate((np.zeros(6), before + share * (after - before)))
            effort = self._effort(course.positions[tick + 1], course.velocities[tick + 1], offset)
            data.qfrc_applied[:] = effort
            mujoco.mj_step2(model, data)
            positions.append(data.qpos.copy())
            velocities.append(data.qvel.copy())
        return positions, velocities

    def _effort(self, target: FloatArray, velocity: FloatArray, offset: FloatArray) -> FloatArray:
        state = message_form(self.data.qpos)
        law, mine = self.law_model, self.data.qvel.copy()
        law.update(state, mine)
        error = np.zeros(N)
        mujoco.mj_differentiatePos(MODEL._model, error, 1.0, self.data.qpos, target)
        actuated = np.arange(N) >= 6
        effort = stable_pd_effort(
            law,
            self.gains.stiffness * actuated,
            self.gains.damping * actuated,
            error + offset,
            mine,
            velocity,
            PERIOD,
        )
        clipped = LAYOUT.clipped(effort, self.gains.effort_limits)
        return clipped + self.passive.effort(state, mine, clipped)


def message_form(position: FloatArray) -> FloatArray:
    """MuJoCo's position (q,) in message form (n,)."""
    found = np.zeros(N)
    mujoco.mj_differentiatePos(MODEL._model, found, 1.0, MODEL.position_of(np.zeros(N)), position)
    return found


def start_of(states: list[ReferenceState]) -> tuple[FloatArray, FloatArray]:
    """Position and velocity (n,) where a reference begins."""
    return states[0].configuration.position, states[0].velocity


@pytest.mark.parametrize(
    ("name", "tick", "size"),
    [("walk", 0, 0.0), ("walk", 70, 0.3), ("backflip", 150, 0.3), ("roll", 200, 1.0)],
)
def test_a_rollout_is_that_of_the_products_law_and_limits(
    name: str, tick: int, size: float
) -> None:
    # Arrange
    course, states = desired(clip(name), tick)
    position, velocity = start_of(states)
    count = (tick + HORIZON - 1) // KNOTS + 2 - course.first_knot
    draws = np.random.default_rng(1).normal(size=(3, count, N - 6))
    used = gains()
    body = MODEL.body(used)

    # Act
    rollouts = RolloutPool(MODEL, 1)
    start = MODEL.position_of(position)
    features, sound = rollouts.simulate(start, velocity, size * draws, course, body)

    # Assert
    assert sound.all()
    for plan, row in zip(size * draws, features, strict=True):
        positions, velocities = PlainRollout(used).positions(position, velocity, plan, course)
        for check in range(HORIZON // CHECKS):
            expected = independent_features(
                positions[CHECKS * (check + 1) - 1],
                velocities[CHECKS * (check + 1) - 1],
                course.positions[CHECKS * (check + 1)],
            )
            np.testing.assert_allclose(row[check], expected, atol=1e-6, rtol=1e-6)
        offsets = Offsets(KNOTS, course.first_knot, plan)
        last = rollouts.state_after(start, velocity, offsets, course, body)
        np.testing.assert_allclose(last[0], positions[-1], atol=1e-6)
        np.testing.assert_allclose(last[1], velocities[-1], atol=1e-5)


def independent_features(
    position: FloatArray, velocity: FloatArray, target: FloatArray
) -> FloatArray:
    """The features (f,) of a state, link by link."""
    law = DynamicsModel(HUMANOID)
    law.update(message_form(position), velocity)
    error = np.zeros(N)
    mujoco.mj_differentiatePos(MODEL._model, error, 1.0, target, position)
    centre, speed = law.centre_of_mass(), law.centre_of_mass_velocity()
    data = law._data
    spin = np.zeros(3)
    for index, link in enumerate(HUMANOID.links):
        moving = law.link_jacobian(index) @ velocity
        turn = data.ximat[index + 1].reshape(3, 3)
        inertia = turn @ np.diag(link.inertia_diagonal) @ turn.T
        spin += link.mass * np.cross(data.xipos[index + 1] - centre, moving[:3] - speed)
        spin += inertia @ moving[3:]
    ends = data.xpos[np.array(HUMANOID.end_effectors) + 1].ravel()
    return np.concatenate((error[3:], velocity[3:], centre, speed, spin, ends))


def test_a_rollout_depends_on_its_own_plan_alone() -> None:
    course, states = desired(clip("walk"), 0)
    position, velocity = start_of(states)
    plans = 0.3 * np.random.default_rng(2).normal(size=(9, 5, N - 6))
    body, start = MODEL.body(gains()), MODEL.position_of(position)

    alone = [
        RolloutPool(MODEL, 1).simulate(start, velocity, plan[np.newaxis], course, body)[0][0]
        for plan in plans
    ]
    for workers in (1, 2, 4):
        together, _ = RolloutPool(MODEL, workers).simulate(start, velocity, plans, course, body)
        assert together.tobytes() == np.array(alone).tobytes()


@pytest.mark.slow
def test_steps_of_several_ticks_are_ticks_of_a_slower_clock() -> None:
    course, states = desired(clip("walk"), 70)
    position, velocity = start_of(states)
    model = ContactModel(HUMANOID, period_s=2 * PERIOD, gravity=9.81, friction=0.45)
    every_other = course._replace(
        positions=course.positions[::2], velocities=course.velocities[::2], check_steps=CHECKS // 2
    )
    stepped = every_other._replace(step_ticks=2)
    slower = every_other._replace(first_tick=35, knot_ticks=KNOTS // 2)
    plans = 0.3 * np.random.default_rng(3).normal(size=(2, 6, N - 6))
    body, start = model.body(gains()), model.position_of(position)

    found, sound = RolloutPool(model, 1, MODEL).simulate(start, velocity, plans, stepped, body)
    expected, _ = RolloutPool(model, 1).simulate(start, velocity, plans, slower, body)

    assert sound.all()
    assert found.shape[1] == HORIZON // CHECKS
    assert found.tobytes() == expected.tobytes()


def test_a_rollout_that_comes_to_nothing_harms_no_other() -> None:
    course, states = desired(clip("walk"), 0)
    position, velocity = start_of(states)
    plans = np.zeros((3, 5, N - 6))
    plans[1] = np.nan
    body, start = MODEL.body(gains()), MODEL.position_of(position)

    features, sound = RolloutPool(MODEL, 1).simulate(start, velocity, plans, course, body)

    assert sound.tolist() == [True, False, True]
    assert features[0].tobytes() == features[2].tobytes()
    assert not features[1].any()


def test_the_floor_carries_it_and_hinges_stay_within_their_limits() -> None:
    course, states = desired(clip("punch"), 500)
    position, velocity = start_of(states)
    body: RolloutModel = MODEL.body(gains(**{"gain_scale.p": 0.0, "gain_scale.d": 0.0}))

    features, sound = RolloutPool(MODEL, 1).simulate(
        MODEL.position_of(position), velocity, np.zeros((1, 6, N - 6)), course, body
    )

    heights = features[0, :, 2 * N - 6 + 2]
    assert sound.all()
    assert heights[-1] < heights[0] - 0.05  # limp, it sinks
    lower, upper = HUMANOID.position_bounds()
    knees = [LAYOUT.joint(f"{side}_knee").start for side in ("left", "right")]
    targets = course.positions[CHECKS::CHECKS]
    for knee in knees:
        turned = np.array([message_form(target)[knee] for target in targets])
        angles = features[0, :, knee - 3] + turned
        assert (angles > lower[knee] - 0.05).all()
        assert (angles < upper[knee] + 0.05).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_mass_matrix_is_factorised_along_its_tree(seed: int) -> None:
    draw = np.random.default_rng(seed)
    law = DynamicsModel(HUMANOID)
    position, velocity = 0.5 * draw.normal(size=N), draw.normal(size=N)
    law.update(position, velocity)
    dense, tree = law.mass_matrix(), MODEL.body(gains()).tree
    entries = np.concatenate(
        [
            dense[row, tree.columns[start : start + length]]
            for row, (start, length) in enumerate(zip(tree.starts, tree.lengths, strict=True))
        ]
    )
    force, momentum = draw.normal(size=N), np.zeros(6)

    mass_matrix.base_momentum(entries, tree, velocity, momentum)
    matrix, solution = MODEL.engine().law_mass, np.zeros(N)
    matrix.entries[:] = entries
    mass_matrix.factorise(matrix)
    mass_matrix.solve(matrix, force, solution)

    np.testing.assert_allclose(momentum, (dense @ velocity)[:6], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(dense @ solution, force, rtol=1e-8, atol=1e-9)


def test_shapes_touch_the_ground_and_those_of_links_that_are_not_above_each_other() -> None:
    model = MODEL._model

    touching = {
        frozenset(model.geom(int(geom)).name for geom in (pair.geom1[0], pair.geom2[0]))
        for pair in (model.pair(number) for number in range(model.npair))
    }

    shapes = [f"{link.name} 0" for link in HUMANOID.links if link.collision_shapes]
    assert all(frozenset((shape, "ground")) in touching for shape in shapes)
    assert frozenset(("left_knee 0", "right_knee 0")) in touching
    assert frozenset(("left_knee 0", "left_ankle 0")) not in touching
    assert frozenset(("root 0", "left_ankle 0")) not in touching
    assert len(touching) == model.npair


@pytest.mark.parametrize("seed", range(3))
def test_a_turn_that_is_less_than_an_angle_is_told_without_its_arc(seed: int) -> None:
    draw = np.random.default_rng(seed)
    told = 0
    for turn in draw.normal(size=(300, 3)):
        quaternion, size = rotations.exp(turn), float(np.linalg.norm(turn))
        angle = float(draw.uniform(-0.5, 3.0))
        x, y, z, w = map(float, quaternion)
        if soft_limits.is_less((x, y, z, w), angle):
            assert min(size, 2.0 * np.pi - size) < angle
            told += 1
        else:
            assert angle < 0.01 or min(size, 2.0 * np.pi - size) > 0.9 * min(angle, 1.9)
    assert told > 30


def test_products_and_systems_are_those_of_linear_algebra() -> None:
    draw = np.random.default_rng(3)
    a, b = draw.normal(size=(7, 13)), draw.normal(size=(13, 5))
    right: Any = draw.normal(size=(7, 3))

    np.testing.assert_allclose(linear.product(a, b), a @ b, rtol=1e-12)
    np.testing.assert_allclose(linear.times(a, b[:, 0].copy()), a @ b[:, 0], rtol=1e-12)
    np.testing.assert_allclose(linear.gram(a), a @ a.T, rtol=1e-12)
    expected = np.linalg.solve(a @ a.T + 0.1 * np.eye(7), right)
    np.testing.assert_allclose(linear.solve(linear.gram(a), 0.1, right), expected, rtol=1e-10)


def test_a_system_without_a_solution_gives_none() -> None:
    found = linear.solve(-np.eye(2), 0.5, np.ones((2, 1)))

    assert not np.isfinite(found).any()


def test_draws_depend_on_their_key_alone_and_are_normal() -> None:
    many = normal_draws((5, 3), (0, 12), 40_000)

    assert normal_draws((5, 3), (0, 12), 1001).tobytes() == many[:1001].tobytes()
    others = [
        normal_draws(key, counter, 1000)
        for key, counter in [
            ((6, 3), (0, 12)),
            ((5, 4), (0, 12)),
            ((5, 3), (1, 12)),
            ((5, 3), (0, 13)),
        ]
    ]
    for other in others:
        assert abs(np.corrcoef(other, many[:1000])[0, 1]) < 0.15
    assert abs(many.mean()) < 0.02
    assert abs(many.std() - 1.0) < 0.02
    assert abs((many**4).mean() - 3.0) < 0.2
    assert abs(np.corrcoef(many[:-1], many[1:])[0, 1]) < 0.02


def test_contacts_are_scaled_by_what_the_links_weigh() -> None:
    # the mean over axes of the acceleration of a link's centre by a unit force, and by a torque
    position = message_form(MODEL.model.qpos0)
    model = still_model(HUMANOID, position)
    inverse = np.linalg.inv(model.mass_matrix())
    origins, axes = model.link_frames(np.arange(len(HUMANOID.links)))
    for index, link in enumerate(HUMANOID.links):
        centre = origins[index] + axes[index] @ link.inertial_pose.position
        jacobian = model.point_jacobian(index, centre)
        gained = np.diag(jacobian @ inverse @ jacobian.T).reshape(2, 3).mean(axis=1)

        np.testing.assert_allclose(MODEL.model.body_invweight0[index + 1], gained, rtol=1e-6)


def test_the_worlds_contacts_are_those_of_engine_mujoco() -> None:
    # Arrange: thrown down, so that it lands on its feet, slides and falls
    rng, ticks = np.random.default_rng(3), 60
    world = simulation("humanoid", engine="mujoco")
    position = world.state.position.copy()
    velocity = np.array([1.5, 0.5, -2.0, *rng.normal(size=N - 3)])
    efforts = 3.0 * rng.normal(size=(ticks, N)) * (np.arange(N) >= 6)
    world.begin_in({world.simulated.setup.name: StampedState(0, position, velocity, np.zeros(N))})
    model = ContactModel(HUMANOID, period_s=PERIOD, gravity=9.81, friction=0.45, contact="world")
    engine, body = model.engine(), model.body(gains())

    # Act
    went_well = let_act(model.position_of(position), velocity, efforts, body, engine)
    for effort in efforts:
        world.advance(effort)

    # Assert: what is left is of rotations that the messages round
    foreseen = model.message_position(engine.position)
    assert went_well
    assert np.abs(velocity - engine.velocity).max() > 10.0  # it has met the ground
    np.testing.assert_allclose(foreseen, world.state.position, atol=1e-7)
    np.testing.assert_allclose(engine.velocity, world.state.velocity, atol=1e-5)
