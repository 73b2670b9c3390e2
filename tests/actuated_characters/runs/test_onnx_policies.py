"""Networks in ONNX play as numpy says of the recorded states, and their runs repeat to the bit."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.cli import main
from actuated_characters.replay.players.controller_parameters import changed_files
from actuated_characters.replay.replay import replay
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.velocities import plan_velocities
from msgs_config.character.loading import load_character
from tests.support.networks import (
    QUADRUPED,
    QUADRUPED_JOINTS,
    QUADRUPED_SIZE,
    Gru,
    Mlp,
    describe,
    quadruped,
    with_history,
)
from tests.support.rotation_matrices import about, matrices
from tests.support.runs import run_plan, run_plan_here, summary_of

RATE, HOLD = 200, 4
DURATION = 0.4
BEGIN = 0.1  # s, of the command
FORWARD, LEFT, TURN = 0.15, 0.05, 0.2
CLOSE = 1e-5  # rad: single precision
FRAMES = 3


def rotation(vector: Any) -> Any:
    """The matrix of a rotation vector, by Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def commanded(tick: int) -> Any:
    """The velocity at a tick: it rises at 1.3 m/s^2 and 1.5 rad/s^2, the defaults, up to what is
    wanted."""
    time = max(tick / RATE - BEGIN, 0.0)
    return np.array((min(FORWARD, 1.3 * time), min(LEFT, 1.3 * time), min(TURN, 1.5 * time)))


def frame(recording: Recording, tick: int, last: Any) -> list[Any]:
    """The present entries of each term."""
    position, velocity = recording.position[tick], recording.velocity[tick]
    names = list(recording.layout.dof_names)
    joints = [names.index(joint) for joint in QUADRUPED_JOINTS]
    return [
        0.25 * velocity[3:6],
        rotation(position[3:6]).T @ (0.0, 0.0, -1.0),
        commanded(tick) * (2.0, 2.0, 0.25),
        position[joints] - QUADRUPED["default_joint_pos"],
        np.clip(velocity[joints], -4.0, 4.0) * 0.05,
        last,
    ]


def plain(frames: list[list[Any]]) -> Any:
    return np.concatenate(frames[-1])


def terms_oldest_first(frames: list[list[Any]]) -> Any:
    """Term by term, its frames; before the first one there were more of it."""
    padded = ([frames[0]] * FRAMES + frames)[-FRAMES:]
    return np.concatenate([each[row] for row in range(6) for each in padded])


def frames_newest_first(frames: list[list[Any]]) -> Any:
    """Frame by frame; before the first one there were zeros."""
    nothing = [np.zeros_like(each) for each in frames[0]]
    padded = ([nothing] * FRAMES + frames)[-FRAMES:]
    return np.concatenate([term for each in padded[::-1] for term in each])


NEWEST = {"history_order": "newest_first", "history_by": "frame", "history_start": "zeros"}
KINDS: dict[str, tuple[Callable[[], Any], dict[str, Any], Callable[[list[list[Any]]], Any]]] = {
    "mlp": (lambda: Mlp(QUADRUPED_SIZE, 12), quadruped(), plain),
    "history": (lambda: Mlp(FRAMES * QUADRUPED_SIZE, 12), with_history(FRAMES), terms_oldest_first),
    "frames": (
        lambda: Mlp(FRAMES * QUADRUPED_SIZE, 12),
        with_history(FRAMES, **NEWEST),
        frames_newest_first,
    ),
    "gru": (lambda: Gru(QUADRUPED_SIZE, 12), quadruped(), plain),
}


def options(kind: str, folder: Path) -> list[str]:
    """The options of a run by a network that is written to a folder."""
    make, description, _ = KINDS[kind]
    file = make().write(folder / "policy.onnx")
    describe(file, description)
    return [
        *("--onnx", str(file), "--character", "laikago", "--duration", str(DURATION)),
        *("--cmd-vel", f"{FORWARD},{LEFT},{TURN}@{BEGIN}"),
        *("--set", f"sim_node.rate:={RATE}", "--set", "controller_node.law:=pd"),
    ]


@pytest.fixture(scope="module", params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def run(kind: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a kind of network, with a keyframe at 0.2 s."""
    folder = tmp_path_factory.mktemp(kind)
    given = [*options(kind, folder), "--set", "sim_node.keyframe_period:=0.2"]
    given += ["--set", "sim_node.keyframe_budget:=100000"]
    assert main(["run", "--in-process", *given, "--output", str(folder / "run")]) == 0
    return folder / "run"


@pytest.mark.slow
def test_targets_are_what_numpy_says_of_the_recorded_states(kind: str, run: Path) -> None:
    recording, (make, _, observation) = read_recording(run), KINDS[kind]
    network, last, frames = make(), np.zeros(12), []
    names = list(recording.layout.dof_names)
    joints = [names.index(joint) for joint in QUADRUPED_JOINTS]
    wanted = np.empty((len(recording.stamps_ns), 12))
    for tick in range(0, len(wanted), HOLD):
        frames.append(frame(recording, tick, last))
        last = network(observation(frames))
        wanted[tick : tick + HOLD] = QUADRUPED["default_joint_pos"] + 0.25 * last

    np.testing.assert_allclose(recording.reference_position[:, joints], wanted, rtol=0, atol=CLOSE)
    assert np.ptp(wanted, axis=0).min() > 0.01  # rad: each of them moves


def test_efforts_are_those_of_a_pd_law_with_the_policys_own_gains(run: Path) -> None:
    recording = read_recording(run)
    names = list(recording.layout.dof_names)
    joints = [names.index(joint) for joint in QUADRUPED_JOINTS]
    errors = recording.reference_position - recording.position
    damping = np.array(QUADRUPED["joint_damping"])
    efforts = 60.0 * errors[:-1, joints] - damping * recording.velocity[:-1, joints]
    inside = np.abs(efforts) < 20.0  # N m: below the limits of the URDF
    assert inside.mean() > 0.9
    np.testing.assert_allclose(recording.effort[:, joints][inside], efforts[inside], atol=1e-9)
    assert not recording.effort[:, :6].any()


@pytest.mark.slow
def test_a_fork_in_the_middle_ends_as_the_run_did(run: Path) -> None:
    output = run.with_name("fork")
    assert main(["fork", str(run), "--at", "0.3", "--output", str(output)]) == 0
    part, whole = read_recording(output), read_recording(run)
    count = len(part.stamps_ns)
    assert count == round(0.2 * RATE) + 1  # from the keyframe on
    for name in ("position", "velocity", "reference_position"):
        assert getattr(part, name).tobytes() == getattr(whole, name)[-count:].tobytes(), name
    assert replay([whole]).identical


@pytest.mark.slow
def test_over_topics_and_in_a_replay_of_the_controller_it_is_the_same_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options("gru", tmp_path)
    given = {"behaviour": "onnx", "onnx": str(tmp_path / "policy.onnx"), "law": "pd"}
    plan = make_plan("laikago", DURATION, {"reference": "commanded"}, {"rate": RATE}, given)
    plan, velocities = plan_velocities(plan, f"{FORWARD},{LEFT},{TURN}@{BEGIN}")
    inputs = PlannedInputs(velocities=velocities)
    for name in ("once", "twice"):
        run_plan_here(plan, tmp_path / name, inputs)

    run_plan(plan, tmp_path / "sent", inputs=inputs)

    hashes = [summary_of(tmp_path / name)["state_hash"] for name in ("once", "twice", "sent")]
    assert hashes == hashes[:1] * 3
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    for place in ("controller", "simulator"):
        assert main(["replay", str(tmp_path / "sent"), "--through-topics", place]) == 0


def test_a_fixed_base_at_half_its_strength(tmp_path: Path) -> None:
    network = Mlp(3, 1, others={"time_step": (1, 1)})
    file = network.write(tmp_path / "policy.onnx")
    terms = {"joint_pos_abs": {}, "joint_vel": {"scale": 0.1}, "last_action": {}}
    given = {"joint_names": ["hinge"], "default_joint_pos": 0.2, "action_offset": 0.5}
    describe(file, quadruped(**given, joint_damping=3.0, action_clip=0.4, observations=terms))
    settings = {"behaviour": "onnx", "onnx": str(file), "law": "pd", "strength.hinge": 0.5}

    run_plan_here(make_plan("pendulum", 0.3, {}, {"rate": RATE}, settings), tmp_path / "run")

    recording, last = read_recording(tmp_path / "run"), 0.0
    position, velocity = recording.position[:, 0], recording.velocity[:, 0]
    targets = np.empty(len(position))
    for tick in range(0, len(position), HOLD):
        seen = np.array((position[tick], 0.1 * velocity[tick], last))
        last = float(np.clip(network(seen)[0], -0.4, 0.4))
        targets[tick : tick + HOLD] = 0.5 + 0.25 * last
    np.testing.assert_allclose(recording.reference_position[:, 0], targets, rtol=0, atol=CLOSE)
    wanted = 0.5 * (60.0 * (targets - position) - 3.0 * velocity)
    np.testing.assert_allclose(recording.effort[:, 0], wanted[:-1], rtol=0, atol=1e-3)


def test_held_joints_follow_the_reference_of_which_the_policy_is_told(tmp_path: Path) -> None:
    layout = load_character("humanoid").layout
    hinges = ["left_knee", "right_elbow"]
    held = [name for name in layout.actuated_joint_names if name not in hinges]
    network = Mlp(7, 2)
    file = network.write(tmp_path / "policy.onnx")
    terms: dict[str, Any] = {"motion_command": {}, "projected_gravity": {}}
    given = {"joint_names": hinges, "held_joints": held, "default_joint_pos": [-0.3, 0.4]}
    describe(file, quadruped(**given, joint_damping=3.0, observations=terms))
    settings = {"behaviour": "onnx", "onnx": str(file)}
    clip = {"reference": "clip", "clip": "walk"}

    run_plan_here(make_plan("humanoid", 0.2, clip, {"rate": RATE}, settings), tmp_path / "run")
    run_plan_here(make_plan("humanoid", 0.2, clip, {"rate": RATE}, {}), tmp_path / "walk")

    found, walk = read_recording(tmp_path / "run"), read_recording(tmp_path / "walk")
    joints = [layout.joint(name).start for name in hinges]
    others = np.setdiff1d(np.arange(layout.size), joints)
    np.testing.assert_array_equal(
        found.reference_position[:, others], walk.reference_position[:, others]
    )
    wanted = np.empty((len(found.stamps_ns), 2))
    for tick in range(0, len(wanted), HOLD):
        motion = walk.reference_position[tick, joints], walk.reference_velocity[tick, joints]
        gravity = rotation(found.position[tick, 3:6]).T @ (0.0, 0.0, -1.0)
        answer = network(np.concatenate((*motion, gravity)))
        wanted[tick : tick + HOLD] = (-0.3, 0.4) + 0.25 * answer
    np.testing.assert_allclose(found.reference_position[:, joints], wanted, rtol=0, atol=CLOSE)


def test_a_description_that_has_changed_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [*options("mlp", tmp_path), "--output", str(tmp_path / "run")]
    assert main(["run", "--in-process", *given]) == 0
    describe(tmp_path / "policy.onnx", quadruped(action_scale=0.2))
    (said,) = changed_files(read_recording(tmp_path / "run"))
    assert said == f"{tmp_path}/policy.yaml is not the file that it was: its content differs"


def test_a_motion_in_the_network_begins_where_the_character_is_and_faces(tmp_path: Path) -> None:
    rng, steps = np.random.default_rng(2), 11
    turns = rng.normal(size=(steps, 2, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    motion = {
        "joint_pos": rng.normal(size=(steps, 12)),
        "joint_vel": rng.normal(size=(steps, 12)),
        "body_pos_w": rng.normal(size=(steps, 2, 3)),
        "body_quat_w": turns,  # wxyz
    }
    network = Mlp(24 + 3 + 6, 12, motion=motion)
    metadata = {  # as whole_body_tracking's exporter writes it
        "joint_names": ",".join(QUADRUPED_JOINTS),
        "joint_stiffness": ",".join(["60.000"] * 12),
        "joint_damping": ",".join(["2.000"] * 12),
        "default_joint_pos": ",".join(["0.000"] * 8 + ["-0.700"] * 4),
        "action_scale": ",".join(["0.250"] * 12),
        "command_names": "motion",
        "observation_names": "command,motion_anchor_pos_b,motion_anchor_ori_b",
        "anchor_body_name": "chassis",
        "body_names": "FR_hip_motor,chassis",
    }
    file = network.write(tmp_path / "policy.onnx", metadata)
    describe(file, {"step_dt": 0.02})
    settings = {"behaviour": "onnx", "onnx": str(file)}
    placed = {"rate": RATE, "placement": [1.0, -2.0, 0.3, 0.8]}
    placed |= {"keyframe_period": 0.1, "keyframe_budget": 100_000}

    run_plan_here(make_plan("laikago", 0.2, {}, placed, settings), tmp_path / "run")

    recording = read_recording(tmp_path / "run")
    joints = [list(recording.layout.dof_names).index(joint) for joint in QUADRUPED_JOINTS]
    places, turned = motion["body_pos_w"][:, 1], matrices(turns[:, 1][:, [1, 2, 3, 0]])
    first = recording.position[0]
    between = rotation(first[3:6]) @ turned[0].T
    about_z = about(2, np.arctan2(between[1, 0], between[0, 0]))
    wanted = np.empty((len(recording.stamps_ns), 12))
    for tick in range(0, len(wanted), HOLD):
        step, position = tick // HOLD, recording.position[tick]
        own = rotation(position[3:6])
        place = about_z @ (places[step] - places[0] * (1, 1, 0)) + first[:3] * (1, 1, 0)
        observation = np.concatenate(
            (
                motion["joint_pos"][step],
                motion["joint_vel"][step],
                own.T @ (place - position[:3]),
                (own.T @ about_z @ turned[step])[:, :2].ravel(),
            )
        )
        pose = [0.0] * 8 + [-0.7] * 4
        wanted[tick : tick + HOLD] = pose + 0.25 * network(observation)
    np.testing.assert_allclose(recording.reference_position[:, joints], wanted, rtol=0, atol=CLOSE)

    assert (
        main(["fork", str(tmp_path / "run"), "--at", "0.15", "--output", str(tmp_path / "f")]) == 0
    )
    part = read_recording(tmp_path / "f")
    assert len(part.stamps_ns) == round(0.1 * RATE) + 1  # from the keyframe on
    assert part.position.tobytes() == recording.position[-len(part.stamps_ns) :].tobytes()
