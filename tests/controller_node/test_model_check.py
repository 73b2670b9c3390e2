"""The simulator's probe, and the controller that compares it with its model."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import String

from actuated_characters.runs.plan import make_plan
from controller_node.model_check import check_agreement
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, Link
from msgs_config.errors import CharacterError, MessageError
from msgs_config.messages import configuration, topics
from msgs_config.messages.probe import DynamicsSample, read_probe
from sim_node import parameters as for_simulator
from sim_node.physics.probe import measure_probe
from tests.support.physics import EVERY_CHARACTER, character, character_id
from tests.support.ros import ControllerClient, Processes, joint_state, wait_until

GRAVITY = 9.81

every_character = pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)


def check(whole: Character, probe: DynamicsSample, gravity: float = GRAVITY) -> None:
    check_agreement(DynamicsModel(whole, gravity), whole.layout, probe)


def with_links(whole: Character, change: Callable[[Link], Link]) -> Character:
    return replace(whole, links=tuple(change(link) for link in whole.links))


# --- the probe -----------------------------------------------------------------------------------


@every_character
def test_a_probe_is_repeated_to_the_bit(name: str) -> None:
    first, second = (measure_probe(character(name), GRAVITY).content() for _ in range(2))

    assert first == second


@every_character
def test_a_probe_is_within_all_limits_and_moves_every_degree_of_freedom(name: str) -> None:
    whole = character(name)

    probe = measure_probe(whole, GRAVITY)

    lower, upper = whole.position_bounds()
    assert (lower < probe.position).all() and (probe.position < upper).all()
    assert probe.velocity.all() and probe.effort.all()
    for joint in whole.moving_joints:
        if joint.soft_limit is not None:
            turn = probe.position[whole.layout.joint(joint.name).entries]
            assert (joint.soft_limit.lower < turn).all() and (turn < joint.soft_limit.upper).all()


def test_a_probe_of_one_mass_is_newtons_second_law() -> None:
    probe = measure_probe(character("lift"), GRAVITY)

    assert probe.kinetic_energy == pytest.approx(0.5 * probe.velocity[0] ** 2, rel=1e-9)
    assert probe.acceleration[0] == pytest.approx(probe.effort[0] - GRAVITY, rel=1e-6)


def test_a_probe_goes_through_json_unchanged() -> None:
    probe = measure_probe(character("humanoid"), GRAVITY)

    again = read_probe(json.loads(json.dumps(probe.content())), len(probe.position))

    assert again.content() == probe.content()


BROKEN: dict[str, Callable[[dict[str, Any]], object]] = {
    "a list": lambda content: [],
    "no effort": lambda content: {k: v for k, v in content.items() if k != "effort"},
    "too short": lambda content: content | {"position": []},
    "words": lambda content: content | {"velocity": ["fast"]},
    "NaN": lambda content: content | {"acceleration": [float("nan")]},
    "a huge number": lambda content: content | {"acceleration": [10**400]},
    "flags": lambda content: content | {"effort": [True]},
    "energy of no number": lambda content: content | {"kinetic_energy": None},
    "infinite energy": lambda content: content | {"kinetic_energy": float("inf")},
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_no_probe_is_refused(case: str) -> None:
    content = measure_probe(character("lift"), GRAVITY).content()

    with pytest.raises(MessageError, match="probe"):
        read_probe(BROKEN[case](content), 1)


NO_MASS = '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0"/></inertial>'
STUCK = {  # whether the base is fixed, what of the lift's URDF is changed, and the reason
    "a base without mass": ("false", ('name="rail"/>', f'name="rail">{NO_MASS}</link>'), "base"),
    "no mass": ("true", ('<mass value="1.0"/>', '<mass value="0"/>'), "nothing with mass|0 mass"),
}


@pytest.mark.parametrize("case", STUCK)
def test_what_cannot_be_moved_is_refused_with_the_reason(tmp_path: Path, case: str) -> None:
    fixed, change, reason = STUCK[case]
    urdf = character("lift").loading.urdf_text
    (tmp_path / "stuck.urdf").write_text(urdf.replace(*change))
    file = tmp_path / "stuck.yaml"
    file.write_text(f"urdf: stuck.urdf\nfixed_base: {fixed}\ninertia: file\n")

    with pytest.raises(CharacterError, match=reason):
        measure_probe(load_character(str(file)), GRAVITY)


# --- the comparison ------------------------------------------------------------------------------


@every_character
def test_every_character_agrees_a_hundred_times_better_than_it_must(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("controller_node.model_check._MAX_DIFFERENCE", 1e-4)

    check(character(name), measure_probe(character(name), GRAVITY))


def heavier(link: Link) -> Link:
    return replace(link, mass=1.1 * link.mass)


def stubborn(link: Link) -> Link:
    x, y, z = link.inertia_diagonal
    return replace(link, inertia_diagonal=(2.0 * x, 2.0 * y, 2.0 * z))


def scaled(link: Link) -> Link:
    """Twice as large, of the same mass."""

    def double(pose: Any) -> Any:
        x, y, z = pose.position
        return replace(pose, position=(2.0 * x, 2.0 * y, 2.0 * z))

    joint = replace(link.joint, pose_in_parent=double(link.joint.pose_in_parent))
    return replace(link, joint=joint, inertial_pose=double(link.inertial_pose))


def damped(link: Link) -> Link:
    return replace(link, joint=replace(link.joint, damping=link.joint.damping + 1.0))


DIFFERENT = {"mass": heavier, "inertia": stubborn, "scale": scaled, "damping": damped}


@pytest.mark.parametrize("change", DIFFERENT)
@pytest.mark.parametrize("name", ["humanoid", "franka_panda", "pendulum"])
def test_another_character_is_refused_with_what_differs(name: str, change: str) -> None:
    probe = measure_probe(character(name), GRAVITY)

    with pytest.raises(CharacterError, match=r"differs by [\d.e+]+ %; .*scale.*gravity.*inertia"):
        check(with_links(character(name), DIFFERENT[change]), probe)


@pytest.mark.parametrize("name", ["humanoid", "franka_panda", "lift", "pendulum"])
def test_another_gravity_is_refused(name: str) -> None:
    probe = measure_probe(character(name), GRAVITY)

    with pytest.raises(CharacterError, match="gravity"):
        check(character(name), probe, gravity=9.0)


@pytest.mark.parametrize("link", ["chest", "left_ankle", "right_hip", "left_elbow"])
def test_the_inertia_of_one_link_of_many_is_not_overlooked(link: str) -> None:
    probe = measure_probe(character("humanoid"), GRAVITY)
    changed = with_links(
        character("humanoid"), lambda each: stubborn(each) if each.name == link else each
    )

    with pytest.raises(CharacterError, match="differs by"):
        check(changed, probe)


def test_a_run_compares_before_it_starts_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    real = measure_probe

    def of_another_engine(whole: Character, gravity: float, engine: str) -> DynamicsSample:
        probe = real(whole, gravity, engine)
        return replace(probe, kinetic_energy=1.5 * probe.kinetic_energy)

    monkeypatch.setattr("actuated_characters.runs.plan.measure_probe", of_another_engine)

    with pytest.raises(CharacterError, match="kinetic energy differs by 33"):
        make_plan("lift", 1.0, {}, {}, {})


# --- over topics ---------------------------------------------------------------------------------


def description(name: str, probe: DynamicsSample | None, **given: object) -> str:
    """What a simulator says of itself."""
    whole = character(name)
    values = for_simulator.resolve_alone(whole, given)
    return configuration.describe(whole, values, probe=probe)


def test_a_configuration_carries_the_probe_and_may_lack_it() -> None:
    probe = measure_probe(character("lift"), GRAVITY)

    with_probe = configuration.parse(description("lift", probe))
    without = configuration.parse(description("lift", None))

    assert with_probe.probe is not None
    assert with_probe.probe.content() == probe.content()
    assert without.probe is None


REFUSED_SIMULATORS = {
    "another gravity": (lambda: measure_probe(character("pendulum"), 1.62), "pendulum", {}),
    "another character": (lambda: measure_probe(character("lift"), GRAVITY), "lift", {}),
    "another rate": (
        lambda: measure_probe(character("pendulum"), GRAVITY),
        "pendulum",
        {"rate": 500},
    ),
    "another placement": (
        lambda: measure_probe(character("pendulum"), GRAVITY),
        "pendulum",
        {"placement": [1.0, 0.0, 0.0, 0.0]},
    ),
}


@pytest.mark.parametrize("case", REFUSED_SIMULATORS)
def test_a_controller_says_in_one_line_that_a_simulator_is_another_and_waits_for_one_that_fits(
    processes: Processes, simulator: ControllerClient, case: str
) -> None:
    measure, name, given = REFUSED_SIMULATORS[case]
    node = processes.controller("pendulum")
    simulators = simulator.speak(topics.CONFIGURATION.of(topics.SIM_NODE))

    simulators.publish(String(data=description(name, measure(), **given)))
    wait_until(lambda: node.stderr, "a line")
    simulator.spin_until(simulators.get_subscription_count, "a controller that listens")
    probe = measure_probe(character("pendulum"), GRAVITY)
    simulators.publish(String(data=description("pendulum", probe)))

    simulator.ask(joint_state(4_166_666, ["hinge"], [0.5], [0.0]))  # of tick 1 at 240 Hz
    (line,) = node.stderr.splitlines()
    assert "state ignored: the simulator's " in line
    assert "waiting for a simulator that fits" in line
    assert node.exit_code is None


@pytest.mark.parametrize("text", ["{}", "no JSON", "without a probe"])
def test_a_controller_works_with_a_simulator_that_says_nothing_of_itself(
    processes: Processes, simulator: ControllerClient, text: str
) -> None:
    node = processes.controller("pendulum")
    simulators = simulator.speak(topics.CONFIGURATION.of(topics.SIM_NODE))
    simulator.spin_until(simulators.get_subscription_count, "a controller that listens")

    simulators.publish(
        String(data=description("lift", None) if text == "without a probe" else text)
    )
    probe = measure_probe(character("pendulum"), GRAVITY)
    simulators.publish(String(data=description("pendulum", probe)))

    simulator.ask(joint_state(4_166_666, ["hinge"], [0.5], [0.0]))  # of tick 1 at 240 Hz
    assert node.exit_code is None
