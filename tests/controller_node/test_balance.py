"""Balance on two feet: its mechanics against theory and the other engine, and who stands."""

import numpy as np
import pytest

from controller_node.balance import BalanceController, BalanceGains
from controller_node.control_laws import stable_pd_effort
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import (
    EVERY_CHARACTER,
    character,
    character_id,
    controller,
    link_motions,
    link_poses,
    random_state,
    simulation,
    still_world,
)

FEET = ("right_ankle", "left_ankle")
BENT = {"hip_z": 0.02, "knee": -0.15, "ankle_z": 0.13}  # rad; their sum is zero: flat soles
SOFT_HIPS = {
    f"gains.{side}_hip.{kind}": gain
    for side in ("right", "left")
    for kind, gain in (("p", 70.0), ("d", 25.0))
}
HALF_SOLE = (0.0885, 0.045)  # m, along x and y: the URDF's box, a quarter of its size
RATE_HZ = 240
PUSH_S = 0.1
STEP = 1e-6  # rad or m, of a difference quotient
PUSHES = [("forward", (10.0, 0.0)), ("backward", (-9.0, 0.0)), ("left", (0.0, 16.0))]
PUSHES.append(("right", (0.0, -16.0)))  # N s at the chest

every_character = pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)


@pytest.fixture(scope="module")
def humanoid() -> Character:
    return character("humanoid")


@pytest.fixture(scope="module")
def balance(humanoid: Character) -> BalanceController:
    return BalanceController(humanoid, FEET)


def bent_pose(humanoid: Character) -> FloatArray:
    """Standing with bent knees, the soles flat on the ground."""
    position = np.array(humanoid.rest_position)
    position[2] = 0.878
    for side in ("right", "left"):
        for part, angle in BENT.items():
            position[humanoid.layout.dof_names.index(f"{side}_{part}")] = angle
    return position


def model_at(whole: Character, position: FloatArray, velocity: FloatArray) -> DynamicsModel:
    model = DynamicsModel(whole)
    model.update(position, velocity)
    return model


def still(whole: Character, position: FloatArray) -> DynamicsModel:
    return model_at(whole, position, np.zeros(whole.layout.size))


def moved(layout: JointLayout, position: FloatArray, motion: FloatArray) -> FloatArray:
    """Where a motion (n,) leads to, which is a velocity times a short time."""
    after: FloatArray = position + motion
    for entries in layout.rotation_entries:
        turn = rotations.multiply(rotations.exp(position[entries]), rotations.exp(motion[entries]))
        after[entries] = rotations.log(turn)
    return after


def turned(rotation_vector: FloatArray, turn_in_world: tuple[float, float, float]) -> FloatArray:
    """A rotation vector (3,) after one more turn in the world, rad."""
    turn = rotations.exp(np.array(turn_in_world))
    return rotations.log(rotations.multiply(turn, rotations.exp(rotation_vector)))


def leaning_pose(humanoid: Character, turn_in_world: tuple[float, float, float]) -> FloatArray:
    """The bent pose with all but the feet turned about the ankles, rad."""
    position = bent_pose(humanoid)
    upright = rotations.exp(position[3:6])
    position[3:6] = turned(position[3:6], turn_in_world)
    for side in ("right", "left"):
        joints = [humanoid.layout.joint(f"{side}_{part}") for part in ("hip", "ankle")]
        hip, ankle = (rotations.exp(position[joint.entries]) for joint in joints)
        knee = rotations.exp(np.array([0.0, 0.0, BENT["knee"]]))
        leg = rotations.multiply(hip, knee)
        shank = rotations.multiply(rotations.exp(position[3:6]), leg)
        foot = rotations.multiply(rotations.multiply(upright, leg), ankle)
        level = rotations.multiply(rotations.conjugate(shank), foot)
        position[joints[1].entries] = rotations.log(level)
    return position


# The model's centre of mass


@every_character
def test_the_jacobian_of_the_centre_of_mass_is_its_derivative(name: str) -> None:
    # Arrange
    whole, rng = character(name), np.random.default_rng(2)
    position, velocity = random_state(whole, rng)

    # Act
    jacobian = model_at(whole, position, velocity).centre_of_mass_jacobian()

    # Assert
    for dof, column in enumerate(jacobian.T):
        motion = np.zeros(whole.layout.size)
        motion[dof] = STEP
        ahead, behind = (
            still(whole, moved(whole.layout, position, sign * motion)).centre_of_mass()
            for sign in (1.0, -1.0)
        )
        assert column == pytest.approx((ahead - behind) / (2.0 * STEP), abs=1e-8)


@every_character
def test_a_points_jacobian_is_the_derivative_of_where_it_moves(name: str) -> None:
    # Arrange
    whole, rng = character(name), np.random.default_rng(3)
    position, velocity = random_state(whole, rng)
    link = len(whole.links) - 1
    in_link = rng.normal(size=3)

    def place(motion: FloatArray) -> tuple[FloatArray, FloatArray]:
        origins, turns = still(whole, moved(whole.layout, position, motion)).link_poses()
        return origins[link] + rotations.rotate(turns[link], in_link), turns[link]

    # Act
    model = model_at(whole, position, velocity)
    jacobian = model.point_jacobian(link, place(np.zeros(whole.layout.size))[0])

    # Assert
    (ahead, turn_ahead), (behind, turn_behind) = place(STEP * velocity), place(-STEP * velocity)
    turned = rotations.log(rotations.multiply(turn_ahead, rotations.conjugate(turn_behind)))
    moving = np.concatenate((ahead - behind, turned)) / (2.0 * STEP)
    assert jacobian @ velocity == pytest.approx(moving, abs=1e-7)


def test_the_weight_is_what_gravity_does_to_the_root(humanoid: Character) -> None:
    model = still(humanoid, bent_pose(humanoid))

    assert model.weight == pytest.approx(humanoid.mass * 9.81)
    assert model.weight == pytest.approx(model.gravity_force()[2])


# What the ground is to do


def test_the_feet_together_exert_the_virtual_force_through_the_centre_of_mass(
    humanoid: Character, balance: BalanceController
) -> None:
    # Arrange: the body leans on flat soles, so little that none is at its limit
    gains = BalanceGains()
    position = leaning_pose(humanoid, (0.004, 0.006, 0.0))
    velocity = np.random.default_rng(5).uniform(-0.02, 0.02, humanoid.layout.size)
    model = model_at(humanoid, position, velocity)

    # Act
    ground = balance.ground_wrenches(model, gains)

    # Assert
    centre, motion = model.centre_of_mass(), model.centre_of_mass_velocity()
    offset = centre - ground.points.mean(axis=0)
    wanted = -gains.stiffness * offset - gains.damping * motion
    wanted[2] = model.weight - gains.damping * motion[2]
    assert ground.forces.sum(axis=0) == pytest.approx(wanted)
    moments = np.cross(ground.points - centre, ground.forces) + ground.moments
    assert moments.sum(axis=0)[:2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("side", [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5), (0.4, -0.3)])
def test_the_centre_of_pressure_stays_inside_the_soles_and_the_force_inside_the_cone(
    humanoid: Character, balance: BalanceController, side: tuple[float, float]
) -> None:
    # Arrange: it falls fast, with its soles flat
    position = bent_pose(humanoid)
    velocity = np.zeros(humanoid.layout.size)
    velocity[:2] = side
    model = model_at(humanoid, position, velocity)

    # Act
    ground = balance.ground_wrenches(model, BalanceGains())

    # Assert
    half_length, half_width = HALF_SOLE
    loads = ground.forces[:, 2]
    assert loads.min() >= 0.0
    assert (np.abs(ground.moments[:, 1]) <= loads * half_length + 1e-9).all()
    assert (np.abs(ground.moments[:, 0]) <= loads * half_width + 1e-9).all()
    horizontal = np.linalg.norm(ground.forces.sum(axis=0)[:2])
    assert horizontal <= BalanceGains().friction * loads.sum() * (1.0 + 1e-12)
    at_the_edge = np.isclose(np.abs(ground.moments[:, 1]), loads * half_length)
    assert at_the_edge.all() == (side[0] != 0.0)
    alone = loads[0 if side[1] < 0.0 else 1]  # right, left
    assert (alone == pytest.approx(model.weight)) == (side[1] != 0.0)


def test_the_soles_are_the_lower_faces_of_the_feet(
    humanoid: Character, balance: BalanceController
) -> None:
    rest = np.array(humanoid.rest_position)

    ground = balance.ground_wrenches(still(humanoid, rest), BalanceGains())

    assert ground.points[:, 0] == pytest.approx(0.045, abs=1e-3)  # ahead of the ankles
    assert ground.points[:, 1] == pytest.approx([-0.085, 0.085], abs=1e-3)
    assert ground.points[:, 2] == pytest.approx(0.0, abs=1e-3)


# The effort


def test_the_effort_is_statics_by_hand(humanoid: Character, balance: BalanceController) -> None:
    # Arrange: what each joint has to hold by the engine's own numbers, link by link
    position = bent_pose(humanoid)
    position += np.random.default_rng(6).uniform(-0.2, 0.2, humanoid.layout.size)
    model = still(humanoid, position)
    with still_world(humanoid) as world:
        world.body.set_state(position, np.zeros(humanoid.layout.size))
        origins, turns = link_poses(world.body, humanoid)
        motions = link_motions(world.body, humanoid)
    ground = balance.ground_wrenches(model, BalanceGains())
    feet = [[link.name for link in humanoid.links].index(name) for name in FEET]
    gravity = np.array([0.0, 0.0, -9.81])
    expected = np.zeros(humanoid.layout.size)
    for index, link in enumerate(humanoid.links):
        if link.joint.type in (JointType.FIXED, JointType.FLOATING):
            continue
        load = np.zeros(3)  # moment about the joint of what acts on all that it moves
        for other in below(humanoid, index):
            load += np.cross(motions[other].centre - origins[index], motions[other].mass * gravity)
        for foot, point, force, moment in zip(
            feet, ground.points, ground.forces, ground.moments, strict=True
        ):
            if foot in below(humanoid, index):
                load += np.cross(point - origins[index], force) + moment
        load_in_link = -rotations.rotate(rotations.conjugate(turns[index]), load)
        is_hinge = link.joint.type is JointType.REVOLUTE
        entries = humanoid.layout.joint(link.joint.name).entries
        expected[entries] = (
            load_in_link @ np.array(link.joint.axis_in_child) if is_hinge else load_in_link
        )

    # Act
    effort = balance.effort(model, BalanceGains())

    # Assert
    assert effort[:6].tolist() == [0.0] * 6
    assert np.abs(expected).max() > 1.0
    assert effort == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("law", ["computed_torque", "pd_gravity"])
def test_the_weight_is_borne_once_whatever_law_it_is_added_to(
    humanoid: Character, law: str
) -> None:
    """At the elbow, which bears nothing but its own arm."""
    elbow = humanoid.layout.joint("right_elbow").start
    position = bent_pose(humanoid)
    position[elbow] = 1.5
    state = StampedState(TickClock(RATE_HZ).stamp_ns(1), position, 0.0 * position, None)
    limp = {
        "gain_scale.p": 0.0,
        "gain_scale.d": 0.0,
        "root_assistance": False,
        "balance.enabled": True,
    }

    effort, _ = controller("humanoid", law=law, **limp).compute_effort(state, state.stamp_ns)

    weight = still(humanoid, position).bias_force()[elbow]
    assert abs(weight) > 0.1
    assert effort[elbow] == pytest.approx(weight, rel=1e-9)


def below(whole: Character, index: int) -> list[int]:
    """A link and all that it carries."""
    carried = [index]
    for other, link in enumerate(whole.links):
        if link.parent in carried:
            carried.append(other)
    return carried


def test_without_gains_and_over_the_feet_nothing_would_move(
    humanoid: Character, balance: BalanceController
) -> None:
    # Arrange: the ground's wrenches hold the root, the effort the joints
    model = still(humanoid, bent_pose(humanoid))
    gains = BalanceGains(stiffness=0.0)

    # Act
    effort = balance.effort(model, gains)

    # Assert
    ground = balance.ground_wrenches(model, gains)
    force = effort - model.bias_force()
    for name, point, *wrench in zip(
        FEET, ground.points, ground.forces, ground.moments, strict=True
    ):
        link = [link.name for link in humanoid.links].index(name)
        force += model.point_jacobian(link, point).T @ np.concatenate(wrench)
    assert force == pytest.approx(0.0, abs=1e-9)


# Who stands


class Stance:
    """A humanoid that holds the pose with bent knees, by its joints alone."""

    def __init__(self, humanoid: Character, gains: BalanceGains | None, **given: object) -> None:
        self.pose = bent_pose(humanoid)
        layout = humanoid.layout
        given = {"initial_position": self.pose.tolist(), **given}
        self._run = simulation("humanoid", commanded_joints=layout.actuated_joint_names, **given)
        rate_hz = self._run.settings.rate_hz
        driver = controller("humanoid", root_assistance=False, rate=rate_hz, **SOFT_HIPS)
        self._posture = driver.settings.gains
        self._model, self._period = DynamicsModel(humanoid), 1.0 / rate_hz
        self._balance, self._gains = BalanceController(humanoid, FEET), gains
        self.states = b""

    def effort(self) -> FloatArray:
        state, model, layout = self._run.state, self._model, self._run.layout
        model.update(state.position, state.velocity)
        posture = stable_pd_effort(
            model,
            self._posture.stiffness,
            self._posture.damping,
            model.compute_error(state.position, self.pose),
            state.velocity,
            np.zeros(layout.size),
            self._period,
            0.0,
        )
        if self._gains is not None:
            posture += self._balance.effort(model, self._gains)
        return layout.clipped(posture, self._posture.effort_limits)

    def hold(self, seconds: float, *pushes: ExternalWrench) -> None:
        for _ in range(round(seconds / self._period)):
            state = self._run.advance(self.effort(), *pushes)
            self.states += state.position.tobytes() + state.velocity.tobytes()

    def push(self, impulse: tuple[float, float]) -> None:
        """Push the chest, at its centre of mass, by an impulse in N s."""
        character_ = self._run.simulated.character
        chest = [link.name for link in character_.links].index("chest")
        wrench = np.array([*impulse, 0.0, 0.0, 0.0, 0.0]) / PUSH_S
        point = np.array(character_.links[chest].inertial_pose.position)
        self.hold(PUSH_S, ExternalWrench(chest, wrench, point, first_tick=0, ticks=10**9))

    @property
    def stands(self) -> bool:
        position = self._run.state.position
        up = rotations.rotate(rotations.exp(position[3:6]), np.array([0.0, 1.0, 0.0]))
        return bool(position[2] > 0.8 * self.pose[2] and up[2] > 0.9)

    @property
    def fastest(self) -> float:
        """Largest entry of the velocity, rad/s or m/s."""
        return float(np.abs(self._run.state.velocity).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    "given", [{}, {"friction": 0.7}, {"friction": 1.0}, {"rate": 480}], ids=str
)
def test_the_humanoid_stands_still_by_its_joints_alone(
    humanoid: Character, given: dict[str, object]
) -> None:
    stance = Stance(humanoid, BalanceGains(), **given)

    stance.hold(10.0 if not given else 4.0)

    assert stance.stands
    assert stance.fastest < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_it_stands_from_poses_beside_its_own(humanoid: Character, seed: int) -> None:
    # Arrange
    position = bent_pose(humanoid)
    position[6:] += np.random.default_rng(seed).uniform(-0.04, 0.04, humanoid.layout.size - 6)
    lower, upper = humanoid.position_bounds()
    position = np.clip(position, lower, upper)
    position[2] += 0.004  # m: no corner of a turned sole is in the ground

    # Act
    stance = Stance(humanoid, BalanceGains(), initial_position=position.tolist())
    stance.hold(4.0)

    # Assert
    assert stance.stands


def test_without_the_law_it_falls(humanoid: Character) -> None:
    stance = Stance(humanoid, gains=None)

    stance.hold(3.0)

    assert not stance.stands


def test_without_the_virtual_force_a_smaller_push_is_too_much(humanoid: Character) -> None:
    stance = Stance(humanoid, BalanceGains(stiffness=0.0, damping=0.0))

    stance.push((8.0, 0.0))
    stance.hold(3.0)

    assert not stance.stands


@pytest.mark.slow
@pytest.mark.parametrize("impulse", [impulse for _, impulse in PUSHES], ids=[n for n, _ in PUSHES])
def test_it_withstands_a_push(humanoid: Character, impulse: tuple[float, float]) -> None:
    stance = Stance(humanoid, BalanceGains())
    stance.hold(0.5)

    stance.push(impulse)
    stance.hold(5.0)

    assert stance.stands
    assert stance.fastest < 1.0


@pytest.mark.parametrize("turn", [(-1.5, 0.0, 0.0), (1.5, 0.0, 0.0), (0.0, 1.5, 0.0)])
def test_once_it_lies_nothing_is_added(
    humanoid: Character, balance: BalanceController, turn: tuple[float, float, float]
) -> None:
    position = bent_pose(humanoid)
    position[3:6] = turned(position[3:6], turn)

    effort = balance.effort(still(humanoid, position), BalanceGains())

    assert effort.tolist() == [0.0] * humanoid.layout.size


# Mistakes


@pytest.mark.parametrize(
    ("name", "feet", "message"),
    [
        ("humanoid", ["right_ankle", "left_ankel"], "foot 'left_ankel'.*did you mean 'left_ankle'"),
        ("humanoid", ["right_ankle"], "two feet; given: right_ankle"),
        ("humanoid", [], "two feet; given: none"),
        ("humanoid", ["left_ankle", "left_ankle"], "two feet; given: left_ankle, left_ankle"),
        ("humanoid", ["right_ankle", "left_knee"], "'left_knee' has no box"),
        ("humanoid", ["right_ankle", "root"], "no joint moves the foot 'root'"),
        ("franka_panda", ["panda_link1", "panda_link2"], "base is fixed"),
    ],
)
def test_feet_that_cannot_be_balanced_on_are_refused(
    name: str, feet: list[str], message: str
) -> None:
    with pytest.raises(CharacterError, match=message):
        BalanceController(character(name), feet)
