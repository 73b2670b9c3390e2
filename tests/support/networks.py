"""Small networks in ONNX with random weights, as trainers export them, and the same in numpy."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import yaml
from onnx import TensorProto, helper, numpy_helper

HIDDEN = 16


@dataclass
class Mlp:
    """`tanh(x W1 + b1) W2 + b2`; other inputs, by name with their shapes, change nothing."""

    inputs: int
    outputs: int
    seed: int = 0
    others: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    motion: Mapping[str, Any] = field(default_factory=dict)
    """Outputs by time step: tables (steps, ...), as whole_body_tracking's exporter adds them."""
    weights: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        sizes = {"w1": (self.inputs, HIDDEN), "b1": HIDDEN, "w2": (HIDDEN, self.outputs)}
        sizes["b2"] = self.outputs
        self.weights = {
            name: (rng.normal(size=size) / np.sqrt(np.atleast_1d(size)[0])).astype(np.float32)
            for name, size in sizes.items()
        }

    def __call__(self, observation: Any) -> Any:
        """What it answers, in double precision."""
        w = {name: each.astype(float) for name, each in self.weights.items()}
        return np.tanh(observation @ w["w1"] + w["b1"]) @ w["w2"] + w["b2"]

    def write(self, path: Path, metadata: Mapping[str, str] | None = None) -> Path:
        """Its file."""
        nodes = [
            helper.make_node("MatMul", ["obs", "w1"], ["a"]),
            helper.make_node("Add", ["a", "b1"], ["b"]),
            helper.make_node("Tanh", ["b"], ["c"]),
            helper.make_node("MatMul", ["c", "w2"], ["d"]),
            helper.make_node("Add", ["d", "b2"], ["actions"]),
        ]
        inputs = {"obs": (1, self.inputs), **self.others}
        outputs = {"actions": (1, self.outputs)}
        constants = dict(self.weights)
        for name, table in self.motion.items():
            inputs["time_step"], outputs[name] = (1, 1), (1, *table.shape[1:])
            constants[f"{name} table"] = table.astype(np.float32)
            nodes.append(helper.make_node("Gather", [f"{name} table", "step"], [name]))
        if self.motion:
            constants["axis"] = np.array([0], np.int64)
            nodes.insert(
                0, helper.make_node("Cast", ["time_step"], ["whole"], to=TensorProto.INT64)
            )
            nodes.insert(1, helper.make_node("Squeeze", ["whole", "axis"], ["step"]))
        return _write(path, nodes, inputs, outputs, constants, metadata)


@dataclass
class Gru:
    """A gated recurrent unit with one layer, and a linear one behind; ONNX's `linear_before_reset`.

    Equations: Cho et al. 2014, in the form of the ONNX specification of `GRU`.
    """

    inputs: int
    outputs: int
    seed: int = 0
    weights: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        rng, h = np.random.default_rng(self.seed), HIDDEN
        sizes = {
            "w": (1, 3 * h, self.inputs),
            "r": (1, 3 * h, h),
            "b": (1, 6 * h),
            "out": (h, self.outputs),
        }
        self.weights = {
            name: (rng.normal(size=size) / np.sqrt(h)).astype(np.float32)
            for name, size in sizes.items()
        }
        self.hidden = np.zeros(h)

    def __call__(self, observation: Any) -> Any:
        """What it answers, in double precision; it remembers."""
        w, r, b = (self.weights[name][0].astype(float) for name in ("w", "r", "b"))
        wz, wr, wh = np.split(w @ observation, 3)
        rz, rr, rh = np.split(r @ self.hidden, 3)
        bz, br, bh, cz, cr, ch = np.split(b, 6)
        z = 1.0 / (1.0 + np.exp(-(wz + rz + bz + cz)))
        reset = 1.0 / (1.0 + np.exp(-(wr + rr + br + cr)))
        new = np.tanh(wh + bh + reset * (rh + ch))
        self.hidden = (1.0 - z) * new + z * self.hidden
        return self.hidden @ self.weights["out"].astype(float)

    def write(self, path: Path, metadata: Mapping[str, str] | None = None) -> Path:
        """Its file, with the inputs and outputs of rsl_rl's recurrent exporter."""
        axis = np.array([0], np.int64)
        nodes = [
            helper.make_node("Unsqueeze", ["obs", "axis"], ["x"]),
            helper.make_node(
                "GRU",
                ["x", "w", "r", "b", "", "h_in"],
                ["", "h_out"],
                hidden_size=HIDDEN,
                linear_before_reset=1,
            ),
            helper.make_node("Squeeze", ["h_out", "axis"], ["y"]),
            helper.make_node("MatMul", ["y", "out"], ["actions"]),
        ]
        inputs = {"obs": (1, self.inputs), "h_in": (1, 1, HIDDEN)}
        outputs = {"actions": (1, self.outputs), "h_out": (1, 1, HIDDEN)}
        return _write(path, nodes, inputs, outputs, {**self.weights, "axis": axis}, metadata)


def _write(
    path: Path,
    nodes: list[Any],
    inputs: Mapping[str, tuple[int, ...]],
    outputs: Mapping[str, tuple[int, ...]],
    weights: Mapping[str, Any],
    metadata: Mapping[str, str] | None,
) -> Path:
    ends = [
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, each) for name, each in end.items()]
        for end in (inputs, outputs)
    ]
    constants = [numpy_helper.from_array(array, name) for name, array in weights.items()]
    model = helper.make_model(
        helper.make_graph(nodes, "policy", *ends, constants),
        opset_imports=[helper.make_opsetid("", 13)],
        ir_version=8,
    )
    helper.set_model_props(model, dict(metadata or {}))
    onnx.checker.check_model(model, full_check=True)
    path.write_bytes(model.SerializeToString())
    return path


def describe(path: Path, content: Mapping[str, Any]) -> None:
    """Write the YAML file beside a network."""
    path.with_suffix(".yaml").write_text(yaml.safe_dump(dict(content), sort_keys=False))


LEGS = ("FR", "FL", "RR", "RL")
QUADRUPED_JOINTS = [
    f"{leg}_{part}_joint"
    for part in ("hip_motor_2_chassis", "upper_leg_2_hip_motor", "lower_leg_2_upper_leg")
    for leg in LEGS
]
"""The joints of `laikago`, part by part as Isaac Lab orders them; the character's go leg by leg."""
QUADRUPED: dict[str, Any] = {
    "joint_names": QUADRUPED_JOINTS,
    "default_joint_pos": [0.0] * 4 + [0.1] * 4 + [-0.8] * 4,
    "joint_stiffness": 60.0,
    "joint_damping": [2.0] * 4 + [1.5] * 8,
    "action_scale": 0.25,
    "step_dt": 0.02,
    "observations": {
        "base_ang_vel": {"scale": 0.25},
        "projected_gravity": {},
        "velocity_commands": {"scale": [2.0, 2.0, 0.25]},
        "joint_pos_rel": {},
        "joint_vel_rel": {"scale": 0.05, "clip": 4.0},
        "last_action": {},
    },
}
QUADRUPED_SIZE = 45
"""Entries of that observation."""


def quadruped(**changed: Any) -> dict[str, Any]:
    """The description of a policy for `laikago` with some keys of other values; None: without."""
    return {key: value for key, value in (QUADRUPED | changed).items() if value is not None}


def with_history(length: int, **changed: Any) -> dict[str, Any]:
    """The description with a history of all terms."""
    terms = {
        name: {**term, "history_length": length} for name, term in QUADRUPED["observations"].items()
    }
    return quadruped(observations=terms, **changed)
