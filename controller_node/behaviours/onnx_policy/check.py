"""Whether a policy fits its network, and the character and the rate that it is to control."""

import math

import numpy as np

from controller_node.behaviours.onnx_policy.description import Description
from controller_node.behaviours.onnx_policy.motion import OUTPUTS
from controller_node.behaviours.onnx_policy.session import STEP_INPUT, Network
from msgs_config.arrays import SingleArray
from msgs_config.character.layout import SCALAR
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of

_WHOLE = 1e-6  # ticks that a decision may be off whole ones: files have steps of few digits


def check_joints(network: Network, policy: Description, character: Character) -> None:
    """Raise ConfigurationError unless all joints of a character are those of a policy, or held."""
    path, layout = network.path, character.layout
    actuated = layout.actuated_joint_names
    for key, joints in (("joint_names", policy.joints), ("held_joints", policy.held_joints)):
        for joint in joints:
            if joint not in actuated:
                wrong = one_of("joint", joint, actuated)
                raise ConfigurationError(f"{path}: {key}: {wrong} (character '{character.name}')")
    for joint in policy.joints:
        if layout.joint(joint).type not in SCALAR:
            raise ConfigurationError(
                f"{path}: joint '{joint}' of '{character.name}' is a ball joint; a policy's "
                "joints must be hinges or sliders"
            )
    both = set(policy.joints) & set(policy.held_joints)
    if both:
        raise ConfigurationError(f"{path}: joint '{min(both)}' is in joint_names and held_joints")
    missing = [joint for joint in actuated if joint not in {*policy.joints, *policy.held_joints}]
    if missing:
        raise ConfigurationError(
            f"{path}: joint_names lack '{missing[0]}', which '{character.name}' has"
            f"{f' (and {len(missing) - 1} more)' if missing[1:] else ''}; those that the policy "
            "does not drive go to 'held_joints'"
        )
    if not layout.has_floating_base:
        based = next((used.name for used in policy.terms if used.term.needs_base), None)
        if based is not None:
            raise ConfigurationError(
                f"{path}: the term '{based}' needs a floating base; '{character.name}' is fixed "
                "to the world"
            )


def check_motion(network: Network, policy: Description, character: Character) -> None:
    """Raise ConfigurationError if a motion's anchor is no body of the character or the motion."""
    links = [link.name for link in character.links]
    if policy.anchor and policy.anchor not in links:
        wrong = one_of("link", policy.anchor, links)
        raise ConfigurationError(f"{network.path}: anchor_body_name: {wrong}")
    if not policy.needs_motion or STEP_INPUT not in network.inputs:
        return
    missing = [name for name in OUTPUTS if name not in network.outputs]
    if missing:
        raise ConfigurationError(
            f"{network.path}: it has a motion in itself (its input '{STEP_INPUT}'), but no output "
            f"'{missing[0]}'"
        )
    if policy.anchor and policy.anchor not in policy.motion_bodies:
        wrong = one_of("body", policy.anchor, list(policy.motion_bodies))
        raise ConfigurationError(f"{network.path}: anchor_body_name among body_names: {wrong}")


def check_size(network: Network, policy: Description) -> None:
    """Raise ConfigurationError if the observation has not as many entries as the network takes."""
    size = network.inputs[network.observation][-1]
    if isinstance(size, int) and size != policy.size:
        parts = ", ".join(f"{used.name} {used.size}" for used in policy.terms)
        raise ConfigurationError(
            f"{network.path}: its terms have {policy.size} entries ({parts}), but the network's "
            f"input '{network.observation}' takes {size}"
        )


def ticks_of(network: Network, policy: Description, rate_hz: int) -> int:
    """The ticks of a decision. Raises ConfigurationError if they are no whole number."""
    ticks = policy.step_s * rate_hz
    whole = round(ticks)
    if whole < 1 or abs(ticks - whole) > _WHOLE * max(ticks, 1.0):
        better = max(math.ceil(ticks), 1) / policy.step_s
        raise ConfigurationError(
            f"{network.path}: a decision of {policy.step_s:g} s is {ticks:.4g} ticks at {rate_hz} "
            f"Hz; it must be a whole number, as with 'rate' {better:.6g}"
        )
    return whole


def initial_state(network: Network, policy: Description) -> dict[str, SingleArray]:
    """Zeros for each input beside the observation.

    Raises:
        ConfigurationError: one is fed by no output, or its size is not in the file.
    """
    state = {}
    for name, shape in network.inputs.items():
        if name == network.observation:
            continue
        if name != STEP_INPUT and policy.recurrent.get(name) not in network.outputs:
            raise ConfigurationError(
                f"{network.path}: its input '{name}' is fed by no output; say by which in "
                f"'recurrent', such as {{{name}: {network.outputs[-1]}}}"
            )
        # A free size is that of a batch, which is one here.
        state[name] = np.zeros([n if isinstance(n, int) else 1 for n in shape], np.float32)
    return state


def check_answer(network: Network, policy: Description) -> None:
    """Raise ConfigurationError unless the network answers to zeros by one number a joint."""
    state = initial_state(network, policy)
    action, _ = network.evaluate(np.zeros(policy.size, np.float32), state)
    if len(action) != len(policy.joints):
        raise ConfigurationError(
            f"{network.path}: it answers {len(action)} actions, but joint_names are "
            f"{len(policy.joints)}"
        )
    if not np.isfinite(action).all():
        raise ConfigurationError(f"{network.path}: it answers NaN to an observation of zeros")
