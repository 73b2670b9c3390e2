"""A policy as ONNX: ONNX's own reference evaluator answers as the product's network does."""

from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx.reference import ReferenceEvaluator

from actuated_characters.cli import main
from actuated_characters.export.onnx_policy import observation_scales
from controller_node.planner.compiled.network import evaluate
from controller_node.planner.compiled.observation import MOST_SCALES
from controller_node.planner.policy.file import Policy, read_policy, shipped_policies
from msgs_config.arrays import SingleArray
from tests.support.physics import character

CLOSE = 1e-5  # of an action of one: sums of 251 products, in another order


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("onnx") / "walk.onnx"
    assert main(["export", "walk", "--output", str(file)]) == 0
    return file


def answer(policy: Policy, observation: SingleArray) -> SingleArray:
    """What the product answers to an observation in SI units."""
    shift, scale = observation_scales(policy)
    told = np.clip((observation - shift) / scale, -MOST_SCALES, MOST_SCALES).astype(np.float32)
    action = np.empty(len(policy.unit), np.float32)
    evaluate(policy.network, told, action)
    return np.clip(action, -policy.largest, policy.largest)


def observations(policy: Policy, count: int) -> SingleArray:
    """Random ones (count, o), near to the reference and far beyond all limits."""
    (shift, scale), rng = observation_scales(policy), np.random.default_rng(1)
    spread = np.geomspace(0.01, 20.0, count)[:, np.newaxis]
    found: SingleArray = (shift + spread * scale * rng.normal(size=(count, len(shift)))).astype(
        np.float32
    )
    return found


@pytest.mark.parametrize("name", shipped_policies())
def test_another_runtime_gives_the_same_actions(name: str, tmp_path: Path) -> None:
    assert main(["export", name, "--output", str(tmp_path / "policy.onnx")]) == 0
    policy = read_policy(name, character("humanoid"))
    runtime = ReferenceEvaluator(str(tmp_path / "policy.onnx"))

    rows = observations(policy, 100)
    theirs = [runtime.run(None, {"obs": row[np.newaxis]})[0][0] for row in rows]
    ours = [answer(policy, row) for row in rows]

    np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=CLOSE)
    assert np.ptp(ours, axis=0).min() > 0.1  # no action is always the same


def test_its_metadata_say_how_to_run_it(file: Path) -> None:
    model, humanoid = onnx.load(file), character("humanoid")
    policy = read_policy("walk", humanoid)
    onnx.checker.check_model(model, full_check=True)

    said = {entry.key: entry.value.split(",") for entry in model.metadata_props}

    assert tuple(said["joint_names"]) == humanoid.layout.dof_names[6:]
    for name, wanted in (
        ("joint_stiffness", policy.stiffness[6:]),
        ("joint_damping", policy.damping[6:]),
        ("default_joint_pos", humanoid.rest_position[6:]),
        ("action_scale", policy.unit),
    ):
        assert [float(each) for each in said[name]] == list(wanted)
    assert set(said["end_effector_names"]) == {
        *("left_wrist", "right_wrist", "left_ankle", "right_ankle", "neck"),
    }
    assert len(said["observation_names"]) == len(set(said["observation_names"]))
    dims = [int(each) for each in said["observation_dims"]]
    assert len(dims) == len(said["observation_names"])
    assert sum(dims) == model.graph.input[0].type.tensor_type.shape.dim[1].dim_value
    assert said["observation_names"][-1] == "reference_joint_pos_in_0.3_s"
