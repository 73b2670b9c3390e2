"""The files that a controller's parameters name: what it does depends on their content."""

from pathlib import Path

from controller_node.behaviours.factory import BehaviourSettings
from controller_node.behaviours.state_machine.factory import STATE_MACHINE, MachineSettings
from controller_node.behaviours.state_machine.file import machine_path
from controller_node.planner.factory import policy_path
from controller_node.planner.settings import HYBRID, POLICY, PlannerParameters
from controller_node.references.clip import ClipSettings
from controller_node.references.factory import MotionSettings
from controller_node.references.keyframes import KeyframesSettings, keyframes_path
from msgs_config.character.model import Character
from msgs_config.clips.reading import clip_path
from msgs_config.parameters import Values


def files_read(character: Character, values: Values) -> dict[str, Path]:
    """The files in use, by the names of the parameters that name them.

    Raises:
        ActuatedCharactersError: there is no such clip, machine, policy, or file of keyframes.
    """
    files: dict[str, Path] = {}
    reference = MotionSettings.of(values).reference
    if reference == "clip":
        files["clip"] = clip_path(character, ClipSettings.of(values).clip)
    elif reference == "keyframes":
        files["keyframes"] = keyframes_path(KeyframesSettings.of(values).keyframes)
    if BehaviourSettings.of(values).behaviour == STATE_MACHINE:
        files["machine"] = machine_path(MachineSettings.of(values).machine)
    if PlannerParameters.of(values).planner in (POLICY, HYBRID):
        files["policy"] = policy_path(values)
    return files
