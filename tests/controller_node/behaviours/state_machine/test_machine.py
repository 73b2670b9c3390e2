"""The state machine `walk` in the simulator, and what other machines' states do there."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.velocities import plan_velocities
from actuated_characters.runs.planned.wrenches import parse_push
from benchmarks.tables.machines import steps_urdf
from controller_node.balance import BalanceGains
from controller_node.parameters import make_controller
from controller_node.references.trajectory import TrajectoryPoints
from msgs_config.errors import ConfigurationError, MotionError

MACHINE = {"behaviour": "state_machine"}
SIDES = """
sides:
  right: {hip: right_hip, knee: right_knee, ankle: right_ankle, shoulder: right_shoulder}
  left: {hip: left_hip, knee: left_knee, ankle: left_ankle, shoulder: left_shoulder}
"""


def planned(
    seconds: float,
    commands: str = "",
    simulator: Mapping[str, object] | None = None,
    **controller: object,
) -> RunPlan:
    settings, given = {**MACHINE, **controller}, {"wrench_duration": 0.2, **(simulator or {})}
    plan = make_plan("humanoid", seconds, {}, given, settings)
    return plan_velocities(plan, commands)[0] if commands else plan


def run(plan: RunPlan, *pushes: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Positions (t, n), efforts (t, n) and the names of the states of a run."""
    controller = make_controller(plan.character, plan.reference, plan.controller)
    positions, efforts, states = [], [], []
    given = [parse_push(text, plan) for text in pushes]
    for tick in ticks_in_process(plan, given, controller=controller):
        assert controller.mode is not None and tick.following.effort is not None
        positions.append(tick.following.position)
        efforts.append(tick.following.effort)
        facts = controller.mode.phase.facts
        name = f"{facts['state']} {facts['stance']}"
        if states[-1:] != [name]:
            states.append(name)
    return np.array(positions), np.array(efforts), states


def test_it_stands_by_joint_torques_alone() -> None:
    positions, efforts, states = run(planned(1.5))

    assert states == ["stand right"]
    assert positions[-1, 2] == pytest.approx(0.76, abs=0.005)
    assert np.abs(positions[-1, :2]).max() < 0.03
    assert not efforts[:, :6].any()
    limits = planned(0.1).character.effort_limits()[2:]
    assert (planned(0.1).character.layout.norms(efforts)[:, 2:] <= limits + 1e-9).all()


@pytest.mark.slow
def test_it_walks_as_it_is_told_and_stops() -> None:
    positions, efforts, states = run(planned(7.0, "0.6,0,0@0.5 0,0,0@4.5"))

    assert states[:4] == ["stand right", "shift right", "step right", "step left"]
    assert states[-1].startswith("stand")
    speed = (positions[4 * 240, 0] - positions[3 * 240, 0]) / 1.0
    assert speed == pytest.approx(0.6, abs=0.1)
    assert abs(positions[-1, 1]) < 0.15
    assert np.abs(positions[-1, :2] - positions[-120, :2]).max() < 0.03  # it stands
    assert not efforts[:, :6].any()


@pytest.mark.slow
def test_it_turns_and_goes_sideways() -> None:
    positions, _, _ = run(planned(6.0, "0,0.2,0@0.5 0,0,0.5@3"))

    assert positions[3 * 240, 1] == pytest.approx(0.2 * 2.0, abs=0.15)
    start, end = (np.array([positions[row, 3:6]]) for row in (0, -1))
    turned = _yaw(end) - _yaw(start)
    assert turned == pytest.approx(0.5 * 2.7, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        "0.9,0,0.5",
        pytest.param("1.2,0.3,-0.5", marks=pytest.mark.nightly),
        pytest.param("0.6,-0.2,0", marks=pytest.mark.nightly),
        pytest.param("-0.4,-0.3,0.5", marks=pytest.mark.nightly),
    ],
)
def test_it_stays_upright_in_bends_and_aside(command: str) -> None:
    """Where it fell within 6 s while steps were those of a straight way."""
    positions, _, states = run(planned(8.0, f"{command}@0.5"))

    assert positions[:, 2].min() > 0.7
    assert np.abs([_tilt(row[3:6]) for row in positions[::12]]).max() < 0.3
    assert states[-1].split()[0] in ("step", "stride")


@pytest.mark.slow
def test_a_foot_that_hits_the_edge_of_a_step_does_not_stand_yet(tmp_path: Path) -> None:
    """It swings on until it bears the body; taken for standing, it turned on the edge, and fell."""
    ground = tmp_path / "steps.urdf"
    ground.write_text(steps_urdf([0.03, 0.0, 0.03, 0.06], start=1.9))
    positions, _, states = run(
        planned(7.0, "0.6,0,0@0.5", {"terrain": str(ground), "engine": "mujoco"})
    )

    assert positions[-1, 0] > 3.0
    assert positions[:, 2].min() > 0.7
    assert np.abs([_tilt(row[3:6]) for row in positions[::12]]).max() < 0.3
    assert states[-1].startswith("step")


def _tilt(rotation_vector: np.ndarray) -> float:
    from msgs_config.geometry import rotations

    up = rotations.rotate(rotations.exp(rotation_vector), np.array((0.0, 1.0, 0.0)))
    return float(np.arccos(np.clip(up[2], -1.0, 1.0)))


def _yaw(rotation_vector: np.ndarray) -> float:
    from msgs_config.geometry import rotations

    standing = rotations.ABOUT_X_QUARTER_TURN_XYZW
    root = rotations.exp(rotation_vector[0])
    return float(rotations.yaw(rotations.multiply(root, rotations.conjugate(standing))))


@pytest.mark.slow
@pytest.mark.parametrize(
    "force",
    [
        *("120,0,0", "0,-60,0"),
        *(pytest.param(each, marks=pytest.mark.nightly) for each in ("-120,0,0", "0,60,0")),
    ],
)
def test_a_push_is_borne_standing_or_by_a_step(force: str) -> None:
    positions, _, states = run(planned(4.5), f"root:{force}@1")

    assert positions[:, 2].min() > 0.7
    assert states[-1].startswith("stand")
    assert len(states) == 1 or any(name.startswith("catch") for name in states)


def test_targets_in_the_world_stay_and_right_is_a_mirror_of_left(tmp_path: Path) -> None:
    file = tmp_path / "arms.yaml"
    file.write_text(
        SIDES
        + """
start: one
states:
  one:
    feet: {stance: stand, swing: stand}
    root: {height: 0.8, pitch: 0.2}
    blend: 0.3
    targets:
      swing.shoulder: {roll: 0.5, pitch: -0.4}
      chest: {pitch: 0.0, yaw: 0.3}
    ends: [{when: {time: "> 1"}, then: one, swap: true}]
"""
    )
    plan = planned(2.0, machine=str(file))
    layout = plan.character.layout

    positions, _, states = run(plan)

    assert states == ["one right", "one left"]
    before, after = positions[235], positions[-1]
    left, right = (layout.joint(f"{side}_shoulder").entries for side in ("left", "right"))
    # x ahead and y up are mirrored, z to the right is not
    np.testing.assert_allclose(after[right], before[left] * (-1, -1, 1), atol=0.05)
    assert np.abs(before[left]).max() > 0.3
    assert np.abs(before[right]).max() < 0.05
    # the root leans, and the chest is upright all the same
    chest = before[layout.joint("chest").entries]
    assert chest[2] == pytest.approx(0.2, abs=0.05)


def test_a_state_that_tracks_balances_the_torso_by_the_stance_hip(tmp_path: Path) -> None:
    """SIMBICON's torques: those of both hips on the torso together are what holds it."""
    file = tmp_path / "simbicon.yaml"
    file.write_text(
        SIDES
        + """
start: one
states:
  one:
    feet: {stance: free, swing: free}
    tracks: true
    root: {tilt_gains: [300, 30], turn_gains: [300, 30], pitch: 0.3}
    targets:
      swing.hip: {pitch: -0.4, sagittal: [0.5, 0.2], coronal: [0.5, 0.2]}
      swing.knee: -0.8
    efforts: {stance.hip: balance, stance.knee: 5}
    ends: never
"""
    )
    plan = planned(0.1, machine=str(file))
    controller = make_controller(plan.character, plan.reference, plan.controller)
    layout = plan.character.layout
    hip = layout.joint("right_hip").entries

    tick = next(ticks_in_process(plan, controller=controller))

    assert tick.following.effort is not None
    effort = tick.following.effort[hip]
    # at rest, upright: the torso is to lean by 0.3 rad about the left axis, which is -z of the hip
    # (z to the right); the swing hip, told to go ahead by 0.4 rad + 0.5 d + 0.2 v, drives it back
    assert effort[2] == pytest.approx(90.0 - 500.0 * (0.4 + 0.5 * _ahead(plan)), rel=0.05)
    swing = tick.following.effort[layout.joint("left_hip").entries]
    assert swing[2] > 5.0  # softened by the implicit law


@pytest.mark.slow
def test_a_run_is_reached_over_a_walk_and_left_for_a_stand() -> None:
    positions, efforts, states = run(planned(13.0, "2,0,0@0.2 0,0,0@6", machine="run"))

    names = [state.split()[0] for state in states]
    assert list(dict.fromkeys(names))[:3] == ["walk.stand", "walk.shift", "walk.step"]
    begins = names.index("contact")
    ends = len(names) - 1 - names[::-1].index("contact")
    ran = names[begins : ends + 1]
    assert ran[:4] == ["contact", "flight", "contact", "flight"] and set(ran) == set(ran[:2])
    assert names[-1] == "walk.stand"
    speed = (positions[int(6.0 * 240), 0] - positions[int(5.0 * 240), 0]) / 1.0
    assert speed > 1.6
    assert np.abs(positions[-1, :2] - positions[-120, :2]).max() < 0.03  # it stands
    assert not efforts[:, :6].any()


def _ahead(plan: RunPlan) -> float:
    """How far the centre of mass is ahead of the sole at rest, m."""
    from msgs_config.character.dynamics import DynamicsModel

    model = DynamicsModel(plan.character)
    rest = np.array(plan.character.rest_position)
    return float(model.centre_of_mass_at(rest)[0]) - 0.045


@pytest.mark.parametrize(("ahead", "goes"), [(0.2, False), (0.4, True)])
def test_a_machine_takes_over_a_command_up_to_its_speed(
    tmp_path: Path, ahead: float, goes: bool
) -> None:
    file = tmp_path / "slow.yaml"
    file.write_text(
        SIDES
        + f"limits: {{ahead: {ahead}}}"
        + """
start: one
states:
  one:
    feet: {stance: stand, swing: stand}
    root: {height: 0.8}
    ends: [{when: {command_ahead: "> 0.3"}, then: two}]
  two:
    feet: {stance: stand, swing: stand}
    root: {height: 0.8}
    ends: never
"""
    )

    _, _, states = run(planned(0.7, "0.5,0,0@0.05", machine=str(file)))

    assert states == ["one right", "two right"][: 1 + goes]


def test_a_blend_after_a_state_that_tracks_comes_over_from_where_the_body_is(
    tmp_path: Path,
) -> None:
    file = tmp_path / "sinks.yaml"
    file.write_text(
        SIDES
        + """
start: high
gains: {stance.knee: [0, 5], swing.knee: [0, 5], stance.hip: [100, 10], swing.hip: [100, 10]}
states:
  high:
    feet: {stance: stand, swing: stand}
    root: {height: 0.84}
    ends: [{when: {time: "> 0.5"}, then: sinks}]
  sinks:
    feet: {stance: free, swing: free}
    tracks: true
    ends: [{when: {height: "< 0.78"}, then: held}]
  held:
    feet: {stance: stand, swing: stand}
    root: {height: 0.8}
    blend: 1.0
    ends: never
"""
    )

    positions, _, states = run(planned(1.2, machine=str(file)))

    assert states[-1].startswith("held")
    height = positions[:, 2]
    lowered = int(np.argmax(height < 0.78))
    assert height[lowered:].max() < 0.8  # it rises to there, and not to where it was before
    assert height[-1] == pytest.approx(0.8, abs=0.03)


def test_law_and_balance_that_would_add_to_a_machine_are_refused_and_so_is_a_trajectory() -> None:
    plan = planned(1.0)
    controller = make_controller(plan.character, plan.reference, plan.controller)
    gains = controller.settings.gains

    for settings, says in (
        (replace(controller.settings, law="pd_gravity"), "'law' is pd_gravity"),
        (
            replace(controller.settings, balance=BalanceGains(1000.0, 600.0, 0.3)),
            "'balance.enabled' must be false",
        ),
    ):
        with pytest.raises(ConfigurationError, match=says):
            controller.settings = settings
    assert controller.settings.gains is gains
    points = TrajectoryPoints(("chest_rx",), np.array([1.0]), np.zeros((1, 1)), None)
    with pytest.raises(MotionError, match="tracks no trajectory"):
        controller.set_trajectory(points, start_ns=0, now_ns=0, episode_ns=0)
