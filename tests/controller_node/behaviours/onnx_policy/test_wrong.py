"""Each way for a policy to be wrong is one clear line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.cli import main
from controller_node.behaviours.onnx_policy.factory import make_kit
from msgs_config.errors import ConfigurationError, SimulationError
from tests.support.networks import (
    QUADRUPED,
    QUADRUPED_JOINTS,
    QUADRUPED_SIZE,
    Mlp,
    describe,
    quadruped,
)
from tests.support.physics import character

RATE = 200
FIRST = QUADRUPED_JOINTS[0]
OTHERS = QUADRUPED_JOINTS[1:]


def observed(**terms: Any) -> dict[str, Any]:
    """The description with other terms in place of those of that name, or beside them."""
    return quadruped(observations=QUADRUPED["observations"] | terms)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "unknown joint": (
        quadruped(joint_names=["FR_hip_joint", *OTHERS]),
        f"joint_names: unknown joint 'FR_hip_joint'; did you mean '{FIRST}'",
    ),
    "missing joint": (
        quadruped(joint_names=OTHERS, default_joint_pos=0.0, joint_damping=1.0),
        f"joint_names lack '{FIRST}', which 'laikago' has; .* go to 'held_joints'",
    ),
    "joint twice": (
        quadruped(joint_names=[OTHERS[0], *OTHERS]),
        f"joint_names: '{OTHERS[0]}' is named twice",
    ),
    "wrong count": (
        quadruped(default_joint_pos=[0.0] * 11),
        "default_joint_pos is a list; it must be a list of 12 finite numbers",
    ),
    "no default pose": (
        quadruped(default_joint_pos=None),
        "it has no 'default_joint_pos', the pose .*; write it in .*policy.yaml",
    ),
    "no scale": (quadruped(action_scale=None), "it has no 'action_scale', rad or m of an action"),
    "no gains": (quadruped(joint_stiffness=None), "it has no 'joint_stiffness', the PD law's, N m"),
    "no period": (quadruped(step_dt=None), "it has no 'step_dt', s from one decision to the next"),
    "period": (
        quadruped(step_dt=0.0125),
        "a decision of 0.0125 s is 2.5 ticks at 200 Hz; .* as with 'rate' 240",
    ),
    "size": (
        observed(base_height={}),
        r"its terms have 46 entries \(base_ang_vel 3, .*base_height 1\), but .* 'obs' takes 45",
    ),
    "unknown term": (
        observed(projected_gravty={}),
        "unknown term 'observations.projected_gravty'; did you mean 'projected_gravity'",
    ),
    "ambiguous term": (observed(joint_pos={}), "write joint_pos_abs or joint_pos_rel"),
    "order of a quaternion": (
        observed(base_quat={}),
        "observations.base_quat.quaternion is None; it must be .* xyzw or wxyz",
    ),
    "anchor of a motion": (
        observed(motion_anchor_ori_b={}),
        "it has no 'anchor_body_name', the link that a motion's place is said of",
    ),
    "unknown anchor": (
        observed(motion_anchor_ori_b={}) | {"anchor_body_name": "torso_link"},
        "anchor_body_name: unknown link 'torso_link'; .*there are: chassis, ",
    ),
    "no period of a gait": (observed(gait_phase={}), "observations.gait_phase.period is None"),
    "scale of a term": (
        observed(base_ang_vel={"scale": [1.0, 2.0]}),
        "observations.base_ang_vel.scale is a list; it must be a list of 3 finite numbers",
    ),
    "frames of unequal histories": (
        observed(last_action={"history_length": 2}) | {"history_by": "frame"},
        "history_by is 'frame', which needs the same history_length",
    ),
    "unknown key": (quadruped(decimation=4), "unknown key 'decimation'"),
    "recurrent": (quadruped(recurrent=[]), "recurrent is a list; it must be a mapping"),
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return Mlp(QUADRUPED_SIZE, 12).write(tmp_path / "policy.onnx")


def refused(file: Path, name: str = "laikago") -> str:
    """The line of the refusal."""
    with pytest.raises(ConfigurationError) as found:
        make_kit(file, character(name), RATE)
    text = str(found.value)
    assert "\n" not in text and "policy." in text
    return text


@pytest.mark.parametrize("way", WRONG)
def test_a_wrong_description_is_one_line(way: str, file: Path) -> None:
    description, said = WRONG[way]
    describe(file, description)
    with pytest.raises(ConfigurationError, match=said):
        make_kit(file, character("laikago"), RATE)
    refused(file)


def test_a_right_one_is_taken(file: Path) -> None:
    describe(file, quadruped())
    kit = make_kit(file, character("laikago"), RATE)
    assert kit.hold == 4 and kit.policy.size == QUADRUPED_SIZE


def test_joints_that_it_does_not_drive_can_be_held(tmp_path: Path) -> None:
    file = Mlp(QUADRUPED_SIZE - 3, 11).write(tmp_path / "policy.onnx")
    given = {"joint_names": OTHERS, "default_joint_pos": 0.0, "joint_damping": 1.0}
    describe(file, quadruped(**given, held_joints=[FIRST]))
    assert len(make_kit(file, character("laikago"), RATE).entries) == 11


def no_network(path: Path) -> None:
    path.write_bytes(b"no network")


def nothing(path: Path) -> None:
    path.unlink()


def too_few_answers(path: Path) -> None:
    Mlp(QUADRUPED_SIZE, 11).write(path)


def not_a_number(path: Path) -> None:
    network = Mlp(QUADRUPED_SIZE, 12)
    network.weights["b2"][3] = np.nan
    network.write(path)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (no_network, "is no network in ONNX: "),
        (nothing, "policy.onnx: No such file or directory"),
        (too_few_answers, "it answers 11 actions, but joint_names are 12"),
        (not_a_number, "it answers NaN to an observation of zeros"),
    ],
)
def test_a_wrong_network_is_one_line(spoil: Callable[[Path], None], said: str, file: Path) -> None:
    describe(file, quadruped())
    spoil(file)
    assert said in refused(file)


def test_ball_joints_and_a_fixed_base_are_refused(file: Path, tmp_path: Path) -> None:
    layout = character("humanoid").layout
    ball = layout.joints[1].name
    joints = [name for name in layout.actuated_joint_names if name != ball]
    given = {"default_joint_pos": 0.0, "joint_damping": 1.0}
    describe(file, quadruped(joint_names=[ball], held_joints=joints, **given))
    assert f"joint '{ball}' of 'humanoid' is a ball joint" in refused(file, "humanoid")
    describe(file, quadruped(joint_names=["hinge"], **given))
    assert "the term 'base_ang_vel' needs a floating base" in refused(file, "pendulum")


def test_a_motion_in_the_network_must_be_whole(tmp_path: Path) -> None:
    network = Mlp(QUADRUPED_SIZE + 12, 12, others={"time_step": (1, 1)})
    file = network.write(tmp_path / "policy.onnx")
    describe(file, observed(motion_joint_pos={}))
    assert (
        "it has a motion in itself (its input 'time_step'), but no output 'joint_pos'"
        in refused(file)
    )


def test_an_input_that_nothing_feeds_is_named(tmp_path: Path) -> None:
    network = Mlp(QUADRUPED_SIZE, 12, others={"height_map": (1, 9)})
    file = network.write(tmp_path / "policy.onnx")
    describe(file, quadruped())
    said = "its input 'height_map' is fed by no output; say by which in 'recurrent'"
    assert said in refused(file)


def run(file: Path, *options: str) -> int:
    """The exit code of a run that ends before it begins."""
    given = ["--onnx", str(file), "--character", "laikago", "--duration", "0.1"]
    given += ["--set", f"sim_node.rate:={RATE}", "--output", str(file.with_name("run"))]
    return main(["run", "--in-process", *given, *options])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "told a commanded velocity, which needs 'reference' to be commanded or steered"),
        (
            ("--reference", "commanded", "--planner", "predictive"),
            "needs 'planner' to be none; it is predictive",
        ),
        (("--behaviour", "reactive"), "--onnx goes with --behaviour onnx, not reactive"),
    ],
)
def test_what_does_not_go_with_a_policy_is_one_line(
    options: tuple[str, ...], said: str, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    describe(file, quadruped())
    assert run(file, *options) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ") and said in line


def test_without_onnxruntime_the_extra_is_named(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    describe(file, quadruped())
    monkeypatch.setattr(
        "msgs_config.runtime.extras.find_spec", lambda name: None if name == "onnxruntime" else name
    )
    assert run(file, "--reference", "commanded") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "needs the extra 'onnx' (onnxruntime is not installed): pip install" in line


def test_an_answer_that_is_not_finite_ends_the_run_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "policy.onnx"
    network = Mlp(QUADRUPED_SIZE, 12)
    network.weights["w2"][:] = 1e38  # infinity less infinity, once something is seen
    network.weights["b1"][:] = 0.0
    network.write(file)
    describe(file, quadruped())
    assert run(file, "--reference", "commanded") == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert "error: " in line and "is not finite 0.02 s after the first state" in line
    assert SimulationError.__name__ not in line
