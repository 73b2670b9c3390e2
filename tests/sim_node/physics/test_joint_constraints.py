"""Coupled joints and Coulomb friction against closed forms; energy; what is refused."""

from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, LayoutError
from msgs_config.messages.state import StampedState
from sim_node.physics.probe import measure_probe
from tests.support.hands import box_link, hand_on_a_body

pytestmark = pytest.mark.usefixtures("engine")

STEP = 1.0 / 240.0
GRAVITY = 9.81  # m/s^2
LENGTH, MASS = 0.4, 0.5  # m, kg of each arm, which turns about its end
MOMENT = MASS * (0.02**2 + LENGTH**2) / 12.0 + MASS * (LENGTH / 2) ** 2  # kg m^2 about its joint
FREE = '<limit lower="-100" upper="100" effort="100" velocity="9"/>'


def arm(name: str, axis: str, more: str = "", kind: str = "revolute", limit: str = FREE) -> str:
    """A link from `world` that turns about, or slides along, an axis."""
    return (
        box_link(name, MASS, (LENGTH, 0.02, 0.02), (LENGTH / 2, 0.0, 0.0))
        + f'<joint name="{name}_joint" type="{kind}"><parent link="world"/><child link="{name}"/>'
        f'<origin xyz="0 0 2"/><axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def mimic(leader: str, multiplier: float = 1.0, offset: float = 0.0) -> str:
    return f'<mimic joint="{leader}_joint" multiplier="{multiplier}" offset="{offset}"/>'


def robot(folder: Path, *parts: str) -> Character:
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="r"><link name="world"/>{"".join(parts)}</robot>')
    return load_character(str(file))


def simulate(
    whole: Character,
    seconds: float,
    effort: dict[str, float] | None = None,
    position: dict[str, float] | None = None,
    velocity: dict[str, float] | None = None,
    **parameters: object,
) -> list[StampedState]:
    """The states of a run under a constant effort, by the names of degrees of freedom."""

    def entries(given: dict[str, float] | None) -> np.ndarray:
        return np.array([(given or {}).get(name, 0.0) for name in whole.layout.dof_names])

    start = StampedState(0, entries(position), entries(velocity), None)
    with ac.Simulation(whole, start, watch_contacts=False, **parameters) as simulation:
        states = [simulation.state]
        while simulation.time < seconds - 0.5 * STEP:
            states.append(simulation.step(entries(effort)))
    return states


# --- friction ------------------------------------------------------------------------------------


def friction(value: float) -> str:
    return f'<dynamics friction="{value}"/>'


def test_friction_slows_a_hinge_by_f_over_i_until_it_rests(tmp_path: Path) -> None:
    whole = robot(tmp_path, arm("a", "0 0 1", friction(0.05)))

    states = simulate(whole, 4.0, velocity={"a_joint": 3.0})

    speeds = np.array([state.velocity[0] for state in states])
    times = np.arange(len(states)) * STEP
    np.testing.assert_allclose(speeds, np.maximum(3.0 - 0.05 / MOMENT * times, 0.0), atol=1e-6)
    assert speeds[-1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_a_pendulum_whose_friction_is_above_its_weight_stays(tmp_path: Path, share: float) -> None:
    torque = MASS * GRAVITY * LENGTH / 2
    whole = robot(tmp_path, arm("a", "0 1 0", friction(torque / share)))

    states = simulate(whole, 5.0)

    assert abs(states[-1].position[0]) < 1e-6


def test_one_below_it_falls_with_the_rest(tmp_path: Path) -> None:
    torque = MASS * GRAVITY * LENGTH / 2
    whole = robot(tmp_path, arm("a", "0 1 0", friction(0.25 * torque)))

    states = simulate(whole, 10 * STEP)

    expected = 0.75 * torque / MOMENT * 10 * STEP
    assert states[-1].velocity[0] == pytest.approx(expected, rel=2e-3)


def test_a_motor_below_the_friction_moves_nothing_and_above_it_the_rest(tmp_path: Path) -> None:
    whole = robot(tmp_path, arm("a", "0 0 1", friction(0.2)))

    stuck, moved = (simulate(whole, 0.5, {"a_joint": effort})[-1] for effort in (0.199, 0.3))

    assert abs(stuck.position[0]) < 1e-9
    assert moved.velocity[0] == pytest.approx(0.1 / MOMENT * 0.5, rel=1e-6)


def test_a_slider_rests_on_its_friction_and_slides_over_it(tmp_path: Path) -> None:
    weight = MASS * GRAVITY
    resting = robot(tmp_path, arm("a", "0 0 1", friction(1.01 * weight), "prismatic"))
    stays = simulate(resting, 2.0)[-1]
    sliding = robot(tmp_path, arm("a", "0 0 1", friction(0.5 * weight), "prismatic"))
    slides = simulate(sliding, 0.25)[-1]

    assert abs(stays.position[0]) < 1e-9
    assert slides.velocity[0] == pytest.approx(-0.5 * GRAVITY * 0.25, rel=1e-6)


def test_friction_of_two_joints_in_a_row_holds_a_chain_of_light_links(tmp_path: Path) -> None:
    text = hand_on_a_body(dynamics='<dynamics friction="0.01"/>').replace('"trunk"', '"world"', 1)
    file = tmp_path / "hand.yaml"
    (tmp_path / "hand.urdf").write_text(text.replace('"trunk"', '"world"'))
    file.write_text(
        "urdf: hand.urdf\nfixed_base: true\nrest_pose: {wrist: 1.4, finger_0_0_joint: 0.8}\n"
        "joints: {shoulder: {friction: 50}, wrist: {friction: 50}}\n"
    )
    whole = load_character(str(file))
    rest = dict(zip(whole.layout.dof_names, whole.rest_position, strict=True))

    states = simulate(whole, 3.0, position=rest, terrain="none")

    np.testing.assert_allclose(states[-1].position, whole.rest_position, atol=1e-4)


def test_the_file_may_take_the_friction_away_or_give_another(tmp_path: Path) -> None:
    robot(tmp_path, arm("a", "0 0 1", friction(0.2)))
    file = tmp_path / "robot.yaml"
    for text, expected in (
        ("", 0.2),
        ("joint_friction: none\n", 0.0),
        ("joints: {a_joint: {friction: 0.3}}\n", 0.3),
    ):
        file.write_text(f"urdf: robot.urdf\n{text}")
        (joint,) = load_character(str(file)).moving_joints
        assert joint.friction == expected


# --- coupling ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("multiplier", "offset"), [(-1.0, 0.0), (0.5, 0.3), (2.0, -0.1)])
def test_an_effort_of_the_leader_moves_both_by_virtual_work(
    tmp_path: Path, multiplier: float, offset: float
) -> None:
    whole = robot(tmp_path, arm("a", "0 0 1"), arm("b", "0 0 1", mimic("a", multiplier, offset)))

    states = simulate(whole, 1.0, {"a_joint": 0.05})

    positions = np.array([state.position for state in states])
    np.testing.assert_allclose(positions[:, 1], multiplier * positions[:, 0] + offset, atol=1e-9)
    both = MOMENT * (1.0 + multiplier**2)
    speed = 0.05 / both * (len(states) - 1) * STEP
    assert states[-1].velocity[0] == pytest.approx(speed, rel=1e-6)


def test_a_push_on_the_follower_moves_the_leader(tmp_path: Path) -> None:
    whole = robot(tmp_path, arm("a", "0 0 1"), arm("b", "0 0 1", mimic("a", -2.0)))
    with ac.Simulation(whole, watch_contacts=False, wrench_duration=0.1) as simulation:
        simulation.push("b", torque=(0.0, 0.0, 0.05))
        for _ in range(24):
            state = simulation.step(np.zeros(2))

    assert state.velocity[0] == pytest.approx(-2.0 * 0.05 / (5.0 * MOMENT) * 0.1, rel=1e-6)


def test_a_slider_follows_a_hinge(tmp_path: Path) -> None:
    whole = robot(
        tmp_path, arm("a", "0 0 1"), arm("b", "1 0 0", mimic("a", 0.1, 0.02), "prismatic")
    )

    states = simulate(whole, 1.0, {"a_joint": 0.1})

    expected = 0.1 / (MOMENT + 0.1**2 * MASS) * (len(states) - 1) * STEP
    assert states[-1].velocity[0] == pytest.approx(expected, rel=1e-6)
    assert states[-1].position[1] == pytest.approx(0.1 * states[-1].position[0] + 0.02, abs=1e-9)


def test_coupled_pendulums_keep_their_energy_and_swing_as_one(tmp_path: Path) -> None:
    # the follower's axis points the other way, so that both fall alike, and as the third
    whole = robot(
        tmp_path, arm("a", "0 1 0"), arm("b", "0 -1 0", mimic("a", -1.0)), arm("alone", "0 1 0")
    )

    states = simulate(whole, 3.0, position={"a_joint": 1.0, "alone_joint": 1.0}, substeps=4)

    positions = np.array([state.position for state in states])
    velocities = np.array([state.velocity for state in states])
    assert np.abs(positions[:, 1] + positions[:, 0]).max() < 1e-9
    np.testing.assert_allclose(positions[:, 0], positions[:, 2], atol=1e-6)
    height = -0.5 * LENGTH * np.sin(positions[:, 0])
    energy = MOMENT * velocities[:, 0] ** 2 + 2.0 * MASS * GRAVITY * height
    assert np.ptp(energy) < 0.01 * np.ptp(2.0 * MASS * GRAVITY * height)


def test_the_coupling_bears_light_fingers_that_fall(tmp_path: Path) -> None:
    file = tmp_path / "hand.urdf"
    file.write_text(hand_on_a_body(mimics=True))
    whole = load_character(str(file))
    worst = 0.0
    with ac.Simulation(whole, watch_contacts=False) as simulation:
        while simulation.time < 3.0:
            state = simulation.step(np.zeros(whole.layout.size))
            worst = max(worst, np.abs(whole.coupling.violation(state.position)).max())

    assert worst < 1e-8
    assert np.abs(state.velocity).max() < 0.1  # it lies there


def test_a_snapshot_goes_on_to_the_bit_with_friction_coupling_and_contacts(tmp_path: Path) -> None:
    file = tmp_path / "hand.urdf"
    dynamics = '<dynamics damping="0.001" friction="0.003"/>'
    file.write_text(hand_on_a_body(mimics=True, dynamics=dynamics))
    whole = load_character(str(file))
    limp = np.zeros(whole.layout.size)
    with ac.Simulation(whole) as first, ac.Simulation(whole) as second:
        for _ in range(60):
            first.step(limp)
        second._simulation.load_snapshot(first._simulation.snapshot())
        for _ in range(60):
            np.testing.assert_array_equal(first.step(limp).position, second.step(limp).position)


def test_a_chain_of_followers_follows_its_first_leader(tmp_path: Path) -> None:
    whole = robot(
        tmp_path,
        arm("c", "0 0 1", mimic("b", 3.0, 0.1)),
        arm("b", "0 0 1", mimic("a", -2.0, 0.2)),
        arm("a", "0 0 1"),
    )

    state = simulate(whole, 0.5, {"a_joint": 0.05})[-1]

    at = dict(zip(whole.layout.dof_names, state.position, strict=True))
    assert at["b_joint"] == pytest.approx(-2.0 * at["a_joint"] + 0.2, abs=1e-9)
    assert at["c_joint"] == pytest.approx(3.0 * at["b_joint"] + 0.1, abs=1e-9)


def test_followers_begin_where_their_leaders_say(tmp_path: Path) -> None:
    whole = robot(tmp_path, arm("a", "0 0 1"), arm("b", "0 0 1", mimic("a", 2.0, 0.5)))

    start = simulate(whole, STEP, position={"a_joint": 0.3, "b_joint": 9.0})[0]

    assert start.position.tolist() == [0.3, 1.1]
    assert whole.rest_position == (0.0, 0.5)


def test_an_effort_of_a_follower_is_refused(tmp_path: Path) -> None:
    whole = robot(tmp_path, arm("a", "0 0 1"), arm("b", "0 0 1", mimic("a")))

    assert whole.layout.actuated_joint_names == ["a_joint"]
    with ac.Simulation(whole) as simulation:
        with pytest.raises(ConfigurationError, match=r"'b_joint' is 0\.1; it mimics 'a_joint'"):
            simulation.step(np.array([0.0, 0.1]))
        simulation.step(np.array([0.1, 0.0]))
    with pytest.raises(LayoutError, match="'b_joint' mimics 'a_joint' and has no motor"):
        whole.check_driven(["a_joint", "b_joint"])


def test_the_controller_drives_leaders_alone_and_tracks(tmp_path: Path) -> None:
    whole = robot(tmp_path, arm("a", "0 1 0"), arm("b", "0 1 0", mimic("a", -0.5, 0.2)))
    for law in ("stable_pd", "computed_torque", "pd_gravity"):
        controller = ac.Controller(whole, reference="sine", law=law)
        errors = []
        with ac.Simulation(whole, controller.start) as simulation:
            while simulation.time < 3.0:
                effort, reference = controller.compute(simulation.state)
                assert effort[1] == 0.0
                errors.append(np.abs(simulation.state.position - reference.position).max())
                simulation.step(effort)
        assert max(errors) < (0.05 if law == "stable_pd" else 0.02), law


def test_the_probe_knows_neither_friction_nor_coupling(tmp_path: Path) -> None:
    free = robot(tmp_path, arm("a", "0 1 0"), arm("b", "0 1 0"))
    coupled = robot(tmp_path, arm("a", "0 1 0", friction(1.0)), arm("b", "0 1 0", mimic("a", 1.0)))

    np.testing.assert_array_equal(
        measure_probe(free, GRAVITY).acceleration, measure_probe(coupled, GRAVITY).acceleration
    )


def test_a_hinge_with_friction_that_leans_on_its_limit_is_solved_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Friction and limit must not take turns at letting it go until the trials are over."""
    limit = '<limit lower="-1" upper="1" effort="100" velocity="9"/>'
    whole = robot(tmp_path, arm("a", "0 1 0", friction(0.1), limit=limit))
    solves = []
    solve = DynamicsModel.solve

    def counted(self: DynamicsModel, *given: object) -> object:
        solves.append(given)
        return solve(self, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(DynamicsModel, "solve", counted)

    states = simulate(whole, 1.0, {"a_joint": 5.0}, {"a_joint": 0.99})

    assert abs(states[-1].position[0] - 1.0) < 0.01
    assert len(solves) <= 4 * len(states)
