"""What theory expects of the lift: against closed forms, and against what the simulator does."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.viewer.controls.expected_motion import ExpectedMotion, exponential
from actuated_characters.viewer.drawing.sample import CharacterSample
from lecture.theory.second_order import step_response
from msgs_config.character.loading import load_character
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import WrenchArrays

GRAVITY = 9.81  # m/s^2


def sample(time: float, height: float, speed: float = 0.0) -> CharacterSample:
    state = StampedState(round(1e9 * time), np.array([height]), np.array([speed]), np.zeros(1))
    return CharacterSample(state=state, reference=np.array([1.0]))


def expected(law: str, kp: float, kd: float, ki: float = 0.0) -> ExpectedMotion:
    motion = ExpectedMotion(load_character("lift"))
    change(motion, law, kp, kd, ki)
    return motion


def change(motion: ExpectedMotion, law: str, kp: float, kd: float, ki: float = 0.0) -> None:
    values = (law, GRAVITY, 1.0, 1.0, 1.0, kp, kd, ki)
    motion.set(dict(zip(motion.parameters, values, strict=True)))


@pytest.mark.parametrize("kd", [4.0, 20.0, 60.0])  # swings, critical, creeps
def test_pd_from_rest_is_the_closed_form(kd: float) -> None:
    motion = expected("pd", 100.0, kd)
    motion.take(sample(0.0, 0.0))
    times = np.linspace(0.0, 3.0, 50)

    theory = step_response(times, 100.0, kd, 1.0, GRAVITY)

    assert [motion.at(time) for time in times] == pytest.approx(theory, abs=1e-9)


def test_pid_removes_the_error_that_pd_is_left_with() -> None:
    pid, pd = expected("pid", 100.0, 20.0, 100.0), expected("pd", 100.0, 20.0)
    for motion in (pid, pd):
        motion.take(sample(0.0, 0.0))

    assert pid.at(30.0) == pytest.approx(1.0, abs=1e-6)
    assert pd.at(30.0) == pytest.approx(1.0 - GRAVITY / 100.0, abs=1e-6)


def test_it_goes_on_from_where_a_change_or_a_push_found_the_mass() -> None:
    motion = expected("pd", 100.0, 20.0)
    motion.take(sample(0.0, 0.0))
    motion.take(sample(1.0, 0.3, 0.3))  # nothing has changed: theory stays as it was
    assert motion.at(1.0) > 0.8
    pushed = sample(1.1, 0.3, 0.5)
    pushed.pushes = WrenchArrays.of_rows(0, ["mass"], [np.ones(6)], [np.zeros(3)])
    motion.take(pushed)

    assert motion.at(1.1) == pytest.approx(0.3)
    assert motion.at(1.101) == pytest.approx(0.3005, abs=1e-4)


def test_pid_begins_without_an_integral_where_the_law_was_another_one() -> None:
    motion = expected("pd", 20.0, 6.0)
    motion.take(sample(0.0, 0.0))
    rest = 1.0 - GRAVITY / 20.0
    change(motion, "pid", 20.0, 6.0, 20.0)
    motion.take(sample(30.0, rest))

    fresh = expected("pid", 20.0, 6.0, 20.0)
    fresh.take(sample(30.0, rest))

    times = (30.3, 30.5, 31.0)
    assert [motion.at(time) for time in times] == [fresh.at(time) for time in times]


def test_pid_keeps_its_integral_where_its_gain_changes_and_dips() -> None:
    motion = expected("pid", 20.0, 6.0, 20.0)
    motion.take(sample(0.0, 0.0))
    motion.take(sample(30.0, 1.0, 0.1))
    change(motion, "pid", 20.0, 6.0, 10.0)
    motion.take(sample(60.0, 1.0))

    # at rest the old integral carried the weight; half of it pulls half as hard
    acceleration = (motion.at(60.002) - 2.0 * motion.at(60.001) + motion.at(60.0)) / 1e-6
    assert acceleration == pytest.approx(-GRAVITY / 2.0, rel=0.02)


def test_a_reset_begins_anew_though_time_goes_on() -> None:
    motion = expected("pid", 100.0, 20.0, 100.0)
    for number in range(100):
        motion.take(sample(0.033 * number, motion.at(0.033 * number) if number else 0.0))
    motion.take(sample(3.333, 0.0))
    first = expected("pid", 100.0, 20.0, 100.0)
    first.take(sample(3.333, 0.0))

    assert motion.at(4.0) == first.at(4.0)


def test_half_the_strength_is_half_the_gains() -> None:
    weak = expected("pd", 100.0, 20.0)
    values = ("pd", GRAVITY, 1.0, 1.0, 0.5, 100.0, 20.0, 0.0)
    weak.set(dict(zip(weak.parameters, values, strict=True)))
    weak.take(sample(0.0, 0.0))

    assert weak.at(30.0) == pytest.approx(1.0 - GRAVITY / 50.0, abs=1e-6)


def test_a_controller_that_does_not_answer_changes_nothing() -> None:
    motion = expected("pd", 100.0, 20.0)
    motion.take(sample(0.0, 0.0))
    motion.set({})

    assert motion.at(1.0) > 0.8


@pytest.mark.parametrize(("axis", "turn"), [("0 0 -1", "0 0 0"), ("0 0 1", "0 1.5708 0")])
def test_a_slider_that_leads_down_or_aside_has_no_theory(
    tmp_path: Path, axis: str, turn: str
) -> None:
    file = tmp_path / "slider.urdf"
    file.write_text(
        '<robot name="slider"><link name="base"/><link name="mass"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="way" type="prismatic"><origin rpy="{turn}"/><parent link="base"/>'
        f'<child link="mass"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint></robot>'
    )

    assert not ExpectedMotion.fits(load_character(file))


def test_of_another_law_theory_says_nothing() -> None:
    motion = expected("computed_torque", 100.0, 20.0)
    motion.take(sample(0.0, 0.0))

    assert np.isnan(motion.at(1.0))


def test_only_a_vertical_slider_has_it() -> None:
    assert ExpectedMotion.fits(load_character("lift"))
    assert not ExpectedMotion.fits(load_character("pendulum"))
    assert not ExpectedMotion.fits(load_character("humanoid"))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 300.0])
def test_the_exponential_is_that_of_the_eigenvalues(scale: float) -> None:
    root = np.random.default_rng(1).normal(size=(4, 4))
    matrix = -scale * root @ root.T / 10.0  # symmetric, so that its vectors are orthogonal
    values, vectors = np.linalg.eigh(matrix)

    exact = vectors @ np.diag(np.exp(values)) @ vectors.T

    assert exponential(matrix) == pytest.approx(exact, abs=1e-9)
