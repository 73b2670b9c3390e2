"""The behaviour `onnx`, as the parameters' values say."""

from functools import partial
from pathlib import Path

import numpy as np

from controller_node.behaviours.base import BEHAVIOURS, BehaviourChoice
from controller_node.behaviours.onnx_policy.check import (
    check_answer,
    check_joints,
    check_motion,
    check_size,
    ticks_of,
)
from controller_node.behaviours.onnx_policy.description import Description
from controller_node.behaviours.onnx_policy.file import description_path, read_description
from controller_node.behaviours.onnx_policy.policy import OnnxPolicy, PolicyKit
from controller_node.behaviours.onnx_policy.session import Network
from controller_node.planner.settings import NO_PLANNER, PlannerParameters
from controller_node.references.factory import MotionSettings
from msgs_config.arrays import IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import SharedSettings

ONNX = "onnx"
STEERED_REFERENCES = ("commanded", "steered")


class OnnxSettings(Settings):
    """The network that it plays."""

    onnx: str = parameter(
        "", "onnx: the .onnx file of a policy; what it lacks is in the .yaml file beside it"
    )


@BEHAVIOURS.register(ONNX, OnnxSettings)
def _onnx(character: Character, values: Values) -> BehaviourChoice:
    planner, reference = PlannerParameters.of(values).planner, MotionSettings.of(values).reference
    if planner != NO_PLANNER:
        raise ConfigurationError(
            f"parameter 'behaviour' is {ONNX}, which needs 'planner' to be {NO_PLANNER}; it is "
            f"{planner}"
        )
    kit = make_kit(policy_path(values), character, SharedSettings.of(values).rate)
    if kit.policy.needs_command and reference not in STEERED_REFERENCES:
        raise ConfigurationError(
            f"{kit.network.path}: it is told a commanded velocity, which needs 'reference' to be "
            f"{' or '.join(STEERED_REFERENCES)}; it is {reference}"
        )
    return BehaviourChoice(partial(OnnxPolicy, kit), follows_motion=kit.policy.follows_motion)


def policy_path(values: Values) -> Path:
    """The network's file. Raises ConfigurationError if none is named."""
    name = OnnxSettings.of(values).onnx
    if not name:
        raise ConfigurationError(
            f"parameter 'behaviour' is {ONNX}, which needs the parameter '{ONNX}': a .onnx file"
        )
    return Path(name)


def make_kit(path: Path, character: Character, rate_hz: int) -> PolicyKit:
    """What a policy's file makes, for a character at a rate.

    Raises:
        ConfigurationError: a file is missing or wrong, or does not fit the character or the rate.
    """
    network, policy = read_policy(path, character)
    links = [link.name for link in character.links]
    return PolicyKit(
        network=network,
        policy=policy,
        layout=character.layout,
        entries=joint_entries(policy, character),
        hold=ticks_of(network, policy, rate_hz),
        rate_hz=rate_hz,
        model=DynamicsModel(character) if policy.anchor else None,
        anchor=links.index(policy.anchor) if policy.anchor else 0,
    )


def read_policy(path: Path, character: Character) -> tuple[Network, Description]:
    """A network and its description, for a character. Raises as `make_kit`."""
    network = Network(path)
    policy = read_description(network)
    check_joints(network, policy, character)
    check_motion(network, policy, character)
    check_size(network, policy)
    check_answer(network, policy)
    return network, policy


def joint_entries(policy: Description, character: Character) -> IntArray:
    """The entries (m,) of a policy's joints among a character's."""
    return np.array([character.layout.joint(joint).start for joint in policy.joints], dtype=np.intp)


def policy_files(values: Values) -> dict[str, Path]:
    """The files of the policy, by the names that the parameters have for them."""
    path = policy_path(values)
    beside = description_path(path)
    return {ONNX: path} | ({f"{ONNX} description": beside} if beside.exists() else {})
