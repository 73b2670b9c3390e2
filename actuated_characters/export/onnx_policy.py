"""A policy as ONNX, for other runtimes: from what is observed, in SI units, to an action.

Input `obs` (1, f + k d), single precision: the deviation (f,) of the state's features from those of
the reference, and k frames (d,) of the reference, now and ahead, as `observe` writes them before it
scales; its scales and limits are in the graph. Output `actions` (1, a): times `action_scale` they
are what is added to the errors of the joints, which the law tracks. The tanh is that of
`compiled/network.py`: runtimes differ in the order of sums alone.
"""

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from controller_node.planner.compiled.features import FeatureLayout
from controller_node.planner.compiled.network import LARGEST_INPUT, TANH_ABOVE, TANH_BELOW
from controller_node.planner.compiled.observation import MOST_SCALES
from controller_node.planner.policy.file import Policy
from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.character.model import Character
from msgs_config.runtime.extras import require_extra

if TYPE_CHECKING:  # it is of an extra
    from onnx import ModelProto

Constant: TypeAlias = FloatArray | SingleArray | float

_OPSET, _IR_VERSION = 13, 8  # of 2020 and 2021, so that runtimes of any age read them
_INPUT, _OUTPUT = "obs", "actions"
_FEATURES = (  # the parts of features, in their order
    "root_rotation",
    "joint_pos",
    "root_ang_vel",
    "joint_vel",
    "com_pos",
    "com_lin_vel",
    "angular_momentum",
    "end_effector_pos",
)
_FRAME = ("com_pos", "com_lin_vel", "root_x_axis", "root_z_axis", "end_effector_pos", "joint_pos")


def onnx_model(policy: Policy, character: Character) -> "ModelProto":
    """A policy of a character as an ONNX model.

    Raises:
        ConfigurationError: the extra `onnx` is not installed.
    """
    require_extra("onnx", "a policy as ONNX")
    from onnx import TensorProto, checker, helper

    graph = _Graph()
    shift, scale = observation_scales(policy)
    at = graph.clip(graph.add("Div", graph.add("Sub", _INPUT, shift), scale), MOST_SCALES)
    layers = list(zip(policy.network[::2], policy.network[1::2], strict=True))
    for weights, bias in layers[:-1]:
        at = graph.tanh(graph.add("Add", graph.add("MatMul", at, weights), bias))
    weights, bias = layers[-1]
    at = graph.clip(graph.add("Add", graph.add("MatMul", at, weights), bias), policy.largest)
    graph.add("Identity", at, result=_OUTPUT)
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, (1, size))
        for name, size in ((_INPUT, len(shift)), (_OUTPUT, len(policy.unit)))
    ]
    model = helper.make_model(
        helper.make_graph(graph.nodes, "policy", ends[:1], ends[1:], graph.constants),
        opset_imports=[helper.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
        producer_name="actuated_characters",
    )
    helper.set_model_props(model, metadata(policy, character))
    checker.check_model(model, full_check=True)
    return model


def observation_scales(policy: Policy) -> tuple[FloatArray, FloatArray]:
    """What is taken off an observation (f + k d,), and by what it is divided then."""
    scales = policy.scales
    nothing = np.zeros_like(scales.deviation)
    return (
        np.concatenate((nothing, scales.frame_mean.ravel())),
        np.concatenate((scales.deviation, scales.frame_scale.ravel())),
    )


def metadata(policy: Policy, character: Character) -> dict[str, str]:
    """What a runtime has to know beside the graph; of lists the entries, by commas.

    The names are those that rsl_rl's exporters of mjlab and whole_body_tracking write, where they
    have one.
    """
    layout, about, rate = character.layout, policy.about, policy.rate_hz
    ends = [character.links[index].name for index in character.end_effectors]
    features = FeatureLayout(layout.size - 6, len(ends))
    parts = [(f"{name}_error", size) for name, size in zip(_FEATURES, features.sizes, strict=True)]
    for ticks in policy.ahead.tolist():
        parts += [
            (f"reference_{name}_in_{ticks / rate:g}_s", size)
            for name, size in zip(_FRAME, features.frame_sizes, strict=True)
        ]
    found: dict[str, Sequence[object]] = {
        "joint_names": layout.dof_names[6:],
        "joint_stiffness": policy.stiffness[6:].tolist(),
        "joint_damping": policy.damping[6:].tolist(),
        "default_joint_pos": character.rest_position[6:],
        "command_names": ["motion"],
        "observation_names": [name for name, _ in parts],
        "observation_dims": [size for _, size in parts],
        "end_effector_names": ends,
        "action_scale": policy.unit.tolist(),
        "character": [about["character"]],
        "clips": about["clips"],
        "rate_hz": [rate],
        "decision_ticks": [policy.hold],
    }
    return {name: ",".join(map(str, entries)) for name, entries in found.items()}


class _Graph:
    """Nodes and constants of an ONNX graph, named by number."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []
        self._numbers = count()

    def add(self, kind: str, *inputs: str | Constant, result: str = "") -> str:
        """Add an operation; returns the name of its result. Inputs are names or constants."""
        from onnx import helper

        result = result or f"t{next(self._numbers)}"
        names = [each if isinstance(each, str) else self._constant(each) for each in inputs]
        self.nodes.append(helper.make_node(kind, names, [result]))
        return result

    def clip(self, values: str, most: float) -> str:
        """Add the limits of both signs."""
        return self.add("Clip", values, -most, most)

    def tanh(self, values: str) -> str:
        """Add the rational function of `squash`."""
        x = self.clip(values, LARGEST_INPUT)
        s = self.add("Mul", x, x)
        above, below = (self._polynomial(s, each) for each in (TANH_ABOVE, TANH_BELOW))
        return self.add("Div", self.add("Mul", x, above), below)

    def _polynomial(self, variable: str, coefficients: Sequence[np.float32]) -> str:
        """Add a polynomial, by its coefficients from the highest one on (Horner's scheme)."""
        first, second, *rest = map(float, coefficients)
        at = self.add("Add", self.add("Mul", variable, first), second)
        for each in rest:
            at = self.add("Add", self.add("Mul", variable, at), each)
        return at

    def _constant(self, value: Constant) -> str:
        from onnx import numpy_helper

        name = f"c{next(self._numbers)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, np.float32), name))
        return name
