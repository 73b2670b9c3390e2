"""The files that a controller's parameters name: what it does depends on their content."""

from collections.abc import Sequence
from pathlib import Path

from controller_node.behaviours.factory import BehaviourSettings, behaviour_clips
from controller_node.behaviours.onnx_policy.factory import ONNX, policy_files
from controller_node.behaviours.state_machine.factory import STATE_MACHINE, MachineSettings
from controller_node.behaviours.state_machine.file import machine_path
from controller_node.controller_settings import LawSettings
from controller_node.ground import NO_FILE, GroundSettings
from controller_node.planner.settings import HYBRID, POLICY, PlannerParameters
from controller_node.references.clip import ClipSettings
from controller_node.references.factory import MotionSettings
from controller_node.references.keyframes import KeyframesSettings, keyframes_path
from controller_node.references.steering.factory import GaitSettings, clips_of_gait
from controller_node.references.timeline.file import timeline_path
from controller_node.references.timeline.motion import TimelineSettings
from msgs_config.character.model import Character
from msgs_config.clips.reading import clip_path
from msgs_config.parameters import Values
from msgs_config.terrain.file import terrain_path


def files_read(character: Character, values: Values) -> dict[str, Path]:
    """The files in use, by the names that the parameters have for them.

    Raises:
        ActuatedCharactersError: there is no such clip, machine, policy, or file of keyframes.
    """
    behaviour, files = BehaviourSettings.of(values).behaviour, dict[str, Path]()
    clips = behaviour_clips(character, values)
    for name in (*_reference_clips(character, values), *clips):
        files[f"clip {name}"] = clip_path(character, name)
    if MotionSettings.of(values).reference == "keyframes":
        files["keyframes"] = keyframes_path(KeyframesSettings.of(values).keyframes)
    if MotionSettings.of(values).reference == "timeline":
        files["timeline"] = timeline_path(TimelineSettings.of(values).timeline)
    if behaviour == STATE_MACHINE:
        files["machine"] = machine_path(MachineSettings.of(values).machine)
    if behaviour == ONNX:
        files |= policy_files(values)
    if PlannerParameters.of(values).planner in (POLICY, HYBRID):
        from controller_node.planner.policy.choosing import policies_read  # compiled code

        files |= policies_read(character, values, clips)
    if (terrain := GroundSettings.of(values).terrain) not in NO_FILE:
        files["terrain"] = terrain_path(terrain, NO_FILE)
    if feedforward := LawSettings.of(values).feedforward:
        files["feedforward"] = Path(feedforward)
    return files


def _reference_clips(character: Character, values: Values) -> Sequence[str]:
    reference = MotionSettings.of(values).reference
    if reference == "steered":
        return clips_of_gait(character, GaitSettings.of(values))
    return [ClipSettings.of(values).clip] if reference == "clip" else []
