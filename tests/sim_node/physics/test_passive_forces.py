"""Passive damping and soft limits: finite differences of a potential, energy, and stability."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import actuated_characters as ac
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, Joint, SoftLimit
from msgs_config.clips.reading import available_clips, read_clip
from msgs_config.compiled import soft_limits
from msgs_config.geometry import rotations
from sim_node.physics.engine import make_world
from sim_node.physics.passive_forces import PassiveForces
from sim_node.physics.probe import measure_probe
from sim_node.physics.settings import WorldSettings
from tests.support.hands import box_link, hinge
from tests.support.physics import (
    character,
    random_rotation_vector,
    random_state,
    without_self_collision,
)
from tests.support.soft_limits import soft_limit_effort

PROPERTY = settings(deadline=None)
HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
BALLS = [joint for joint in HUMANOID.moving_joints if joint.type is JointType.SPHERICAL]
STEP = 1.0 / 240.0
MOST_EXCESS = np.radians(3.0)  # of a limb that is swung against its limit at 4 rad/s
MIRRORED = np.array([-1.0, -1.0, 1.0])  # the URDF's z is the humanoid's right

every_ball = pytest.mark.parametrize("ball", BALLS, ids=lambda ball: ball.name)


def make_passive_forces(whole: Character, step_s: float) -> PassiveForces:
    return PassiveForces(whole, step_s, 0.0)


@pytest.fixture(scope="module")
def passive() -> PassiveForces:
    """The law itself: what the forces become as steps get shorter."""
    return make_passive_forces(HUMANOID, 1e-12)


def limit_of(ball: Joint) -> SoftLimit:
    assert ball.soft_limit is not None
    return ball.soft_limit


def excess(limit: SoftLimit, turn: FloatArray) -> FloatArray:
    """How far a rotation vector (3,) is outside."""
    return np.maximum(turn - limit.upper, 0.0) + np.minimum(turn - limit.lower, 0.0)


def potential(limit: SoftLimit, turn: FloatArray) -> float:
    """k/2 e^2 of the rotation vector that is nearer to the bounds, r or the longer way round, J."""
    angle = max(float(np.linalg.norm(turn)), 1e-9)
    ways = [turn, turn * (1.0 - 2.0 * np.pi / angle)]
    return 0.5 * limit.stiffness * min(float(np.sum(excess(limit, way) ** 2)) for way in ways)


def torque(
    passive: PassiveForces, ball: Joint, turn: FloatArray, velocity: FloatArray | None = None
) -> FloatArray:
    """The passive torque (3,) at a ball joint, with the others at rest at their rest pose."""
    position, speeds = np.array(HUMANOID.rest_position), np.zeros(LAYOUT.size)
    entries = LAYOUT.joint(ball.name).entries
    position[entries] = turn
    if velocity is not None:
        speeds[entries] = velocity
    effort = passive.effort(position, speeds, np.zeros(LAYOUT.size))
    assert not np.delete(effort, range(entries.start, entries.stop)).any()
    return effort[entries]


def turns_outside(ball: Joint, count: int = 50) -> Iterator[FloatArray]:
    """Random rotation vectors (3,) outside of a ball joint's bounds."""
    rng = np.random.default_rng(1)
    found = 0
    while found < count:
        turn = random_rotation_vector(rng)
        if potential(limit_of(ball), turn) > 0.0:
            found += 1
            yield turn


# --- soft limits ---------------------------------------------------------------------------------


@every_ball
def test_within_its_bounds_a_joint_is_left_alone(passive: PassiveForces, ball: Joint) -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        turn = rng.uniform(limit_of(ball).lower, limit_of(ball).upper)
        if np.linalg.norm(turn) < np.pi:
            assert not torque(passive, ball, turn, rng.normal(size=3)).any()


@every_ball
def test_the_springs_power_is_what_the_potential_loses(passive: PassiveForces, ball: Joint) -> None:
    rng, eps = np.random.default_rng(2), 1e-6
    for turn in turns_outside(ball):
        spin = rng.normal(size=3)

        power = torque(passive, ball, turn) @ spin

        ahead, behind = (
            rotations.log(rotations.multiply(rotations.exp(turn), rotations.exp(sign * eps * spin)))
            for sign in (1.0, -1.0)
        )
        gain = potential(limit_of(ball), ahead) - potential(limit_of(ball), behind)
        assert power == pytest.approx(-gain / (2.0 * eps), rel=1e-5, abs=1e-4)


@every_ball
def test_the_torque_begins_at_zero_and_does_not_jump_at_half_a_turn(
    passive: PassiveForces, ball: Joint
) -> None:
    limit, rng = limit_of(ball), np.random.default_rng(3)
    for axis in range(3):
        turn = np.zeros(3)
        turn[axis] = limit.upper[axis] + 1e-9
        assert np.abs(torque(passive, ball, turn)).max() < 1e-5
    for _ in range(50):
        half_a_turn = random_rotation_vector(rng)
        half_a_turn *= np.pi / np.linalg.norm(half_a_turn)
        depths = [np.sum(excess(limit, sign * half_a_turn) ** 2) for sign in (1.0, -1.0)]
        if depths[0] == pytest.approx(depths[1]):
            continue  # the ridge of the potential, as far from the bounds on either side
        before, after = (
            torque(passive, ball, sign * (1.0 - 1e-9) * half_a_turn) for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(before, after, atol=1e-4)


@every_ball
def test_the_damper_only_takes_energy(passive: PassiveForces, ball: Joint) -> None:
    rng = np.random.default_rng(4)
    taken = 0.0
    for turn in turns_outside(ball):
        spin = rng.normal(size=3)
        damping = torque(passive, ball, turn, spin) - torque(passive, ball, turn)
        assert damping @ spin <= 1e-12
        taken -= damping @ spin
    assert taken > 0.0


@pytest.mark.slow
@every_ball
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("stiffer", [1.0, 1e5])
def test_a_limb_that_is_swung_against_its_limit_is_stopped_and_gains_no_energy(
    ball: Joint, axis: int, stiffer: float
) -> None:
    # weightless, in free space
    whole = with_limits_stiffer(HUMANOID, stiffer)
    passive = make_passive_forces(whole, STEP)
    limit, entries = limit_of(ball), LAYOUT.joint(ball.name).entries
    position, velocity = np.array(HUMANOID.rest_position), np.zeros(LAYOUT.size)
    position[entries.start + axis] = limit.upper[axis] - 0.02
    velocity[entries.start + axis] = 4.0
    stored, energies, touched = [], [], 0
    with make_world(WorldSettings(step_s=STEP, gravity=0.0, ground=False)) as world:
        body = world.add(without_self_collision("humanoid"))
        body.set_state(position, velocity)
        for tick in range(240):
            position, velocity = body.read()
            effort = passive.effort(position, velocity, np.zeros(LAYOUT.size))
            stored.append(potential(limit, position[entries]))
            if tick % 4 == 0:  # it takes as long as all the rest
                energies.append(body.kinetic_energy())
            touched += bool(effort.any())

            body.apply(effort)
            world.step()

    # a free motion of this engine at this step gains up to 2 % in a second
    assert touched
    assert np.sqrt(2.0 * max(stored) / limit.stiffness) < MOST_EXCESS
    assert stored[-1] < 1e-3 * energies[0]
    assert max(energies) < 1.03 * energies[0]


def with_limits_stiffer(whole: Character, times: float) -> Character:
    """The character with stiffness and damping of its soft limits so many times as large."""
    links = []
    for link in whole.links:
        limit = link.joint.soft_limit
        if limit is not None:
            limit = replace(limit, stiffness=times * limit.stiffness, damping=times * limit.damping)
        links.append(replace(link, joint=replace(link.joint, soft_limit=limit)))
    return replace(whole, links=tuple(links))


@pytest.mark.parametrize("step_s", [1.0 / 30.0, STEP, 1e-3])
def test_the_forces_are_those_of_the_motion_that_they_lead_to(step_s: float) -> None:
    # the law at the step's end, on one axis of one joint that is beyond its bound
    knee = LAYOUT.joint("left_knee").entries.start
    limit, entry = limit_of(BALLS[0]), LAYOUT.joint(BALLS[0].name).entries.start
    position, velocity = np.array(HUMANOID.rest_position), np.zeros(LAYOUT.size)
    position[knee] = -0.3
    position[entry] = limit.upper[0] + 0.1
    velocity[entry] = 2.0

    passive = make_passive_forces(HUMANOID, step_s)
    effort = passive.effort(position, velocity, np.zeros(LAYOUT.size))

    model = DynamicsModel(HUMANOID)
    model.update(position, velocity)
    after = velocity + step_s * np.linalg.solve(model.mass_matrix(), effort)
    rate = rotations.right_jacobian_inverse(position[entry : entry + 3]) @ after[entry : entry + 3]
    force = limit.stiffness * (0.1 + step_s * rate[0]) + limit.damping * rate[0]
    assert force > 0.0
    np.testing.assert_allclose(effort[entry], -force, rtol=1e-9)
    assert not np.delete(effort, entry).any()


def test_a_limb_about_to_pass_its_bound_is_slowed_in_the_step_before() -> None:
    passive, ball = make_passive_forces(HUMANOID, STEP), BALLS[0]
    turn, speed = np.zeros(3), np.array([4.0, 0.0, 0.0])
    turn[0] = limit_of(ball).upper[0]

    assert torque(passive, ball, turn - 0.9 * STEP * speed, speed)[0] < 0.0
    assert not torque(passive, ball, turn - 1.1 * STEP * speed, speed).any()


def complementary_forces(
    explicit: FloatArray, implicit: FloatArray, delassus: FloatArray
) -> FloatArray:
    """The forces (m,) of bounds of which each acceleration (m, m) by each force is known."""
    room = soft_limits.room_for_bounds(len(explicit), 3)
    room.explicit[:] = explicit
    room.coupling[:] = implicit[:, np.newaxis] * delassus
    soft_limits.find_complementary_forces(len(explicit), room)
    forces: FloatArray = np.maximum(room.forces, 0.0)
    return forces


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_forces_push_or_are_zero_where_nothing_is_to_be_held(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    delassus = root @ root.T + np.eye(size)
    explicit, implicit = rng.uniform(0.1, 3.0, size), rng.uniform(0.0, 10.0, size)

    forces = complementary_forces(explicit, implicit, delassus)

    # complementarity, to rounding
    lacking = explicit - implicit * (delassus @ forces) - forces
    assert (forces >= 0.0).all()
    np.testing.assert_allclose(lacking[forces > 0.0], 0.0, atol=1e-9)
    assert (lacking[forces == 0.0] <= 1e-9).all()


def test_of_two_bounds_that_push_one_another_away_only_one_pushes() -> None:
    """A unit of the first force moves the second bound's joint back far more than is wanted."""
    delassus = np.array([[1.0, 4.0], [4.0, 17.0]])

    forces = complementary_forces(np.array([10.0, 1.0]), np.ones(2), delassus)

    assert forces.tolist() == [5.0, 0.0]


@every_ball
def test_the_way_round_that_counts_is_the_one_nearer_to_the_bounds(ball: Joint) -> None:
    rng = np.random.default_rng(2)
    for _ in range(100):
        turn = random_rotation_vector(rng)
        limit = limit_of(ball)
        lower, upper = np.array(limit.lower), np.array(limit.upper)
        chosen = np.array(soft_limits.nearer_to(tuple(turn.tolist()), lower, upper))

        apart = np.sum(excess(limit_of(ball), chosen) ** 2)
        assert 0.5 * limit_of(ball).stiffness * apart == pytest.approx(
            potential(limit_of(ball), turn)
        )
        assert rotations.angle_between(rotations.exp(chosen), rotations.exp(turn)) < 1e-7


def test_the_effort_has_the_bits_of_the_one_in_plain_python() -> None:
    rng, compared = np.random.default_rng(3), 0
    passive, model = make_passive_forces(HUMANOID, STEP), DynamicsModel(HUMANOID, 0.0)
    for _ in range(300):
        position, velocity = random_state(HUMANOID, rng)
        found = passive.effort(position, velocity, np.zeros(LAYOUT.size))
        expected = soft_limit_effort(HUMANOID, model, STEP, position, velocity)
        compared += np.count_nonzero(expected)
        np.testing.assert_array_equal(found, expected)

    assert compared > 1000  # entries that some limit acts on


def test_the_soft_limits_leave_a_tenth_of_a_radian_to_every_frame_of_every_clip() -> None:
    for clip in available_clips(HUMANOID):
        frames = read_clip(HUMANOID, clip)
        turns = rotations.log(frames.orientations_xyzw)[:, 1:]  # without the root
        names = [joint.name for joint in LAYOUT.joints if joint.type is JointType.SPHERICAL]
        limits = {ball.name: limit_of(ball) for ball in BALLS}
        for index, name in enumerate(names):
            assert (turns[:, index] >= np.add(limits[name].lower, 0.1)).all(), (clip, name)
            assert (turns[:, index] <= np.subtract(limits[name].upper, 0.1)).all(), (clip, name)


def test_left_and_right_have_the_same_soft_limits() -> None:
    limits = {ball.name: limit_of(ball) for ball in BALLS}
    for name, left in limits.items():
        right = limits[name.replace("left_", "right_")]
        bounds = np.array([left.lower, left.upper]) * MIRRORED
        if name.startswith("left_"):
            np.testing.assert_array_equal(np.sort(bounds, axis=0), [right.lower, right.upper])
            assert (left.stiffness, left.damping) == (right.stiffness, right.damping)


# --- damping -------------------------------------------------------------------------------------


def damped(whole: Character, damping: float) -> Character:
    """The character with each of its joints damped."""
    links = [
        replace(link, joint=replace(link.joint, damping=damping))
        if link.joint.type in (JointType.REVOLUTE, JointType.PRISMATIC, JointType.SPHERICAL)
        else link
        for link in whole.links
    ]
    return replace(whole, links=tuple(links))


def test_damping_is_minus_d_v_in_every_joint_and_not_at_the_base() -> None:
    whole = character("tests/data/damped.yaml")
    velocity = np.random.default_rng(1).normal(size=whole.layout.size)
    expected = dict.fromkeys(["shoulder"], 0.7) | {"wrist": 0.2, "root": 0.0}

    passive = make_passive_forces(whole, 1e-9)
    effort = passive.effort(np.array(whole.rest_position), velocity, np.zeros(whole.layout.size))

    for joint in whole.layout.joints:
        damping = expected.get(joint.name, 5.0)  # as the URDF says of hinges and sliders
        np.testing.assert_allclose(
            effort[joint.entries], -damping * velocity[joint.entries], rtol=1e-5, atol=1e-9
        )
    assert passive.active


def test_what_has_neither_damping_nor_limits_has_no_passive_forces() -> None:
    passive = make_passive_forces(character("franka_panda"), STEP)

    assert not passive.active
    assert not passive.effort(np.zeros(9), np.ones(9), np.zeros(9)).any()


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.floats(1e-4, 1e-1), st.floats(-3.0, 6.0))
def test_damping_is_that_of_the_velocity_that_it_leads_to_in_any_pose(
    seed: int, step: float, exponent: float
) -> None:
    # M (v' - v) / h + C = f - D v', with numpy's own solution of the whole system
    whole = damped(character("kuka"), 10.0**exponent)
    rng = np.random.default_rng(seed)
    position, velocity = random_state(whole, rng)
    known = rng.normal(size=whole.layout.size)

    passive = PassiveForces(whole, step, 9.81)
    effort = passive.effort(position, velocity, known)

    model = DynamicsModel(character("kuka"))
    model.update(position, velocity)
    mass, bias = model.mass_matrix(), model.bias_force()
    after = np.linalg.solve(
        mass + step * 10.0**exponent * np.eye(7), mass @ velocity + step * (known - bias)
    )
    np.testing.assert_allclose(effort, -(10.0**exponent) * after, rtol=1e-6, atol=1e-8)


def test_a_damper_far_too_strong_for_an_explicit_step_sinks_as_it_should() -> None:
    # at d much larger than I / h gravity's torque moves it by m g r / d
    whole = damped(character("pendulum"), 1e4)
    passive = PassiveForces(whole, STEP, 9.81)
    with make_world(WorldSettings(step_s=STEP)) as world:
        body = world.add(whole)
        body.set_state(np.array([0.5]), np.array([3.0]))
        for _ in range(5):
            position, velocity = body.read()
            body.apply(passive.effort(position, velocity, np.zeros(1)))
            world.step()
        position, velocity = body.read()

    model = DynamicsModel(whole)
    model.update(position, np.zeros(1))
    assert velocity[0] == pytest.approx(-model.gravity_force()[0] / 1e4, rel=1e-3)


def test_a_light_chain_is_damped_as_it_bends() -> None:
    """Three links of 10 to 100 g, the heaviest at the end: stable at rest, not where it bends."""
    links = [(0.012, 0.045), (0.015, 0.025), (0.1, 0.03)]
    parts, parent, origin = ['<link name="world"/>'], "world", 'xyz="0 0 0.5" rpy="1.2 0 0"'
    for number, (mass, length) in enumerate(links):
        name = f"link_{number}"
        parts.append(box_link(name, mass, (0.014, 0.014, length), (0.0, 0.0, length / 2)))
        more = '<limit lower="0" upper="1.6"/><dynamics damping="0.1"/>'
        parts.append(hinge(f"{name}_joint", parent, name, origin, "1 0 0", more))
        parent, origin = name, f'xyz="0 0 {length}"'
    with TemporaryDirectory() as folder:
        file = Path(folder) / "finger.urdf"
        file.write_text(f'<robot name="finger">{"".join(parts)}</robot>')
        whole = load_character(str(file))
    fastest = 0.0
    with ac.Simulation(whole) as simulation:
        for _ in range(1200):
            speeds = simulation.step(np.zeros(3)).velocity
            fastest = max(fastest, float(np.abs(speeds).max()))

    # it sinks by its weight of 1.2 N at most 0.1 m from the joint, against 0.1 N m s/rad
    assert fastest < 1.2 * 0.1 / 0.1


def test_the_probes_accelerations_are_those_of_a_rod_and_of_a_mass() -> None:
    inertia = 1.0 / 3.0  # m l^2 / 3 about its end

    for name, moved in (("pendulum", inertia), ("lift", 1.0)):
        sample = measure_probe(character(name), 0.0)
        assert sample.acceleration[0] == pytest.approx(sample.effort[0] / moved, rel=1e-5)
