"""Hands fall with a body, an arm begins in the ground: nothing diverges, a line names the bound."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from msgs_config.character.file import shipped_characters
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.messages.state import StampedState
from sim_node.physics.engine import UNLIMITED_SPEED
from sim_node.physics.short_links import short_joints, speed_bounds
from tests.support.hands import box_link, hand_on_a_body, hinge
from tests.support.physics import TURNED_FRAMES, character

pytestmark = pytest.mark.usefixtures("engine")

STEP = 1.0 / 240.0
LIMIT = 500.0  # rad/s or m/s, the default of `speed_limit`


def load(folder: Path, text: str) -> Character:
    file = folder / "hand.urdf"
    file.write_text(text)
    return load_character(str(file))


def raised(start: StampedState, seed: int) -> StampedState:
    """A start some way up in the air, turned and spinning at random."""
    rng = np.random.default_rng(seed)
    position, velocity = start.position.copy(), start.velocity.copy()
    position[2] += 1.0
    if seed:
        position[3:6] = rng.normal(size=3)
        velocity[3:6] = rng.normal(size=3)
    return replace(start, position=position, velocity=velocity)


def fall(whole: Character, seed: int, *, limp: bool, seconds: float, **parameters: object) -> float:
    """Let a character fall; the largest speed in rad/s or m/s. Raises if it diverges."""
    controller = ac.Controller(whole, reference="hold")
    start, speeds = raised(controller.start, seed), []
    with ac.Simulation(whole, start, watch_contacts=False, **parameters) as simulation:
        while simulation.time < seconds:
            state = simulation.state
            effort = np.zeros(whole.layout.size) if limp else controller.compute_effort(state)
            state = simulation.step(effort)
            speeds.append(float(np.abs(state.velocity).max()))
    assert min(speeds[-12:]) < 20.0  # it lies there, though a light finger twitches
    return max(speeds)


@pytest.mark.parametrize("limp", [True, False], ids=["limp", "driven"])
@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_body_falls_on_its_hand_of_fingers_of_4_g(tmp_path: Path, seed: int, limp: bool) -> None:
    whole = load(tmp_path, hand_on_a_body())

    fastest = fall(whole, seed, limp=limp, seconds=5.0)

    assert fastest <= 100.0 + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("finger_mass", [0.0004, 0.04, 0.4])
@pytest.mark.parametrize("substeps", [1, 4])
def test_it_does_so_whatever_the_fingers_weigh(
    tmp_path: Path, finger_mass: float, substeps: int
) -> None:
    whole = load(tmp_path, hand_on_a_body(finger_mass))

    for seed in range(3):
        fall(whole, seed, limp=True, seconds=2.0, substeps=substeps)


def test_the_fingers_weigh_what_the_file_says(tmp_path: Path) -> None:
    whole = load(tmp_path, hand_on_a_body())

    links = {link.name: link for link in whole.links}
    assert links["finger_2_1"].mass == 0.004
    assert links["finger_2_1"].inertia_diagonal[0] == pytest.approx(
        0.004 * (0.012**2 + 0.025**2) / 12.0, rel=1e-9
    )
    assert whole.mass == pytest.approx(30.0 + 1.5 + 0.3 + 15 * 0.004, rel=1e-12)


def test_a_line_names_the_joints_and_the_bound(tmp_path: Path) -> None:
    file = tmp_path / "hand.urdf"
    file.write_text(hand_on_a_body())

    plan = make_plan(str(file), 1.0, {}, {"substeps": 2}, {})

    (line,) = [line for line in plan.warnings if "rad/s or m/s" in line]
    assert "finger_0_0_joint" in line and "and 11 more" in line and "200 rad/s" in line


@pytest.mark.parametrize("name", [*shipped_characters(), *TURNED_FRAMES])
def test_no_speed_of_a_shipped_character_is_bound(name: str) -> None:
    whole = character(name)

    assert short_joints(whole) == []
    assert speed_bounds(whole, STEP, LIMIT)[True] == UNLIMITED_SPEED


@pytest.mark.parametrize("length", [0.13, 0.17])
def test_short_is_a_pendulum_of_less_than_10_cm(tmp_path: Path, length: float) -> None:
    # a thin rod swings as a pendulum of two thirds of its length
    rod = box_link("rod", 0.1, (1e-4, 1e-4, length), (0.0, 0.0, -length / 2))
    joint = hinge("swing", "world", "rod", 'xyz="0 0 1"', "0 1 0", '<limit lower="-3" upper="3"/>')
    whole = load(tmp_path, f'<robot name="r"><link name="world"/>{rod}{joint}</robot>')

    assert short_joints(whole) == (["swing"] if length * 2.0 / 3.0 < 0.1 else [])


def test_the_bound_grows_with_the_substeps_and_is_well_below_what_counts_as_divergence(
    tmp_path: Path,
) -> None:
    whole = load(tmp_path, hand_on_a_body())

    bounds = [speed_bounds(whole, STEP / substeps, LIMIT)[True] for substeps in (1, 2, 4, 16)]

    assert bounds == pytest.approx([100.0, 200.0, 0.5 * LIMIT, 0.5 * LIMIT])


def test_a_short_pendulum_below_the_bound_swings_as_it_would_without(tmp_path: Path) -> None:
    # small swings about the lowest point: the period is 2 pi sqrt(2 l / 3 g)
    length = 0.06
    rod = box_link("rod", 0.004, (1e-4, 1e-4, length), (0.0, 0.0, -length / 2))
    joint = hinge("swing", "world", "rod", 'xyz="0 0 1"', "0 1 0", '<limit lower="-3" upper="3"/>')
    whole = load(tmp_path, f'<robot name="r"><link name="world"/>{rod}{joint}</robot>')
    start = StampedState(0, np.array([0.02]), np.zeros(1), None)
    angles = []
    with ac.Simulation(whole, start, watch_contacts=False, substeps=4) as simulation:
        while simulation.time < 2.0:
            angles.append(simulation.step(np.zeros(1)).position[0])

    crossings = np.flatnonzero(np.diff(np.sign(angles)))
    period = 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1) / simulation.rate_hz
    assert period == pytest.approx(2.0 * math.pi * math.sqrt(2.0 * length / (3.0 * 9.81)), rel=5e-3)


def arm_along_the_ground(height: float) -> str:
    """An arm along x on a fixed base at a height in m: a sheet turns about itself, a box bends."""
    any_turn = '<limit lower="-3.1" upper="3.1"/>'
    return (
        '<robot name="arm"><link name="mount"/>'
        + box_link("upper", 0.6, (0.1, 0.001, 0.08), (0.05, 0.001, 0.0))
        + box_link("lower", 0.4, (0.3, 0.05, 0.06), (0.15, 0.0, 0.0))
        + hinge("roll", "mount", "upper", f'xyz="0 0 {height}"', "1 0 0", any_turn)
        + hinge("bend", "upper", "lower", 'xyz="0.12 0 0"', "0 1 0", any_turn)
        + "</robot>"
    )


def test_an_arm_whose_base_puts_it_into_the_ground_does_not_diverge_and_is_named(
    tmp_path: Path,
) -> None:
    (tmp_path / "arm.urdf").write_text(arm_along_the_ground(0.0))

    plan = make_plan(
        str(tmp_path / "arm.urdf"), 5.0, {}, {}, {"strength.roll": 0.0, "strength.bend": 0.0}
    )

    (line,) = [line for line in plan.warnings if "into the ground" in line]
    assert "upper 0.04 m deep, lower 0.03 m deep" in line and "100 rad/s" in line
    assert sum(1 for _ in ticks_in_process(plan)) == 1200


@pytest.mark.parametrize(("height", "terrain"), [(0.0, "none"), (0.04, "plane"), (0.2, "plane")])
def test_an_arm_out_of_the_ground_has_no_bound(tmp_path: Path, height: float, terrain: str) -> None:
    (tmp_path / "arm.urdf").write_text(arm_along_the_ground(height))

    plan = make_plan(str(tmp_path / "arm.urdf"), 1.0, {}, {"terrain": terrain}, {})

    assert not [line for line in plan.warnings if "rad/s" in line]
