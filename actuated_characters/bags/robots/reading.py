"""Reads a bag of any ROS 2 robot as a recording: its joint states, and where its base is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from actuated_characters.bags.character_timeline import CONFIGURATION
from actuated_characters.bags.reader import read_topics
from actuated_characters.bags.recording import (
    JOINT_STATE,
    Recording,
    find_bag,
    read_recording,
)
from actuated_characters.bags.robots.base_poses import BaseMotion, base_frames, find_base
from actuated_characters.bags.robots.decoding import read_timed
from actuated_characters.bags.robots.joint_series import JointSeries, collect_joints
from actuated_characters.bags.whole import read_whole
from msgs_config import files
from msgs_config.arrays import IntArray
from msgs_config.character.file import CharacterFile, read_character_file, read_character_texts
from msgs_config.character.layout import ROOT
from msgs_config.character.loading import build_character
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError, ConfigurationError, RecordingError, one_of
from msgs_config.geometry import rotations

_TEXT = "std_msgs/msg/String"
_DESCRIPTION = "robot_description"
_USUAL_TOPIC = "joint_states"
_LEFT_OUT = "left out"  # words in those of a character's warnings that concern what is seen


@dataclass(frozen=True)
class RobotSource:
    """What a user says about a bag: whose it is, and where in it."""

    character: str | None = None
    """Of this project's runs the name of one of several; else a robot's file, or a shipped name."""
    topic: str | None = None  # the topic of joint states
    base: str | None = None  # the topic that says where the base is, or `none`


@dataclass(frozen=True, kw_only=True)
class RobotRecording(Recording):
    """A bag of a robot: t + 1 states at the times at which they came, which are no ticks.

    There are no parameters, commands, contacts or references; velocities and efforts that the
    robot did not publish are NaN. The effort of a tick is that of the state after it.
    """

    topic: str = ""  # the topic of its joint states
    remarks: tuple[str, ...] = ()  # what was left out, and where its base comes from

    @property
    def episode_rows(self) -> IntArray:
        """A robot has no resets."""
        return np.zeros(1, dtype=np.intp)


def read_any(path: Path, source: RobotSource) -> tuple[Recording, ...]:
    """Read the characters of a run, a fork's with its past, or the robot of any other bag.

    Raises:
        RecordingError: there is no complete bag, or it has no joint states that can be used; says
            what to give.
        ActuatedCharactersError: the character cannot be used, or see `read_recordings`.
    """
    bag = find_bag(path)
    types = read_topics(bag)
    if is_own(types) and source.topic is None and source.base is None:
        if source.character is None:
            return read_whole(path)
        return (read_recording(path, source.character),)
    return (read_robot(bag, types, source),)


def is_own(types: Mapping[str, str]) -> bool:
    """Whether topics, with their types, are those of a run of this project's simulator."""
    return any(
        f"/{name}".endswith(f"/{CONFIGURATION}") and kind == _TEXT for name, kind in types.items()
    )


def read_robot(bag: Path, types: Mapping[str, str], source: RobotSource) -> RobotRecording:
    """Read the joint states of one robot; `types` are those of the bag's topics.

    Raises:
        RecordingError: there are none that can be used.
        ActuatedCharactersError: the character cannot be used.
    """
    topic = _joint_topic(bag, types, source.topic)
    file, origin = _character_file(bag, types, source, topic)
    character = _build(file)
    motion = find_base(bag, types, base_frames(character), topic, source.base)
    if motion is not None and not character.layout.has_floating_base:
        character = _floating(file) or character
    try:
        series = collect_joints(topic, read_timed(bag, topic), character)
    except RecordingError as error:
        raise RecordingError(f"bag {bag}: {error}") from error
    missing = [warning for warning in character.warnings if _LEFT_OUT in warning]
    remarks = [f"states of '{topic}'{origin}", *series.remarks, *missing]
    if character.layout.has_floating_base:
        remarks.append(_place_base(series, character, motion))
    return _recording(series, character, topic, tuple(remarks))


def _joint_topic(bag: Path, types: Mapping[str, str], given: str | None) -> str:
    """The topic of joint states: that which is given, the usual one, or the only one."""
    found = sorted(name for name, kind in types.items() if kind == JOINT_STATE)
    if given is not None:
        for name in (given, f"/{given}"):
            if name in found:
                return name
            if name in types:
                raise ConfigurationError(
                    f"--topic {given}: it is a {types[name]}; it must be a {JOINT_STATE}"
                )
        if found:
            raise ConfigurationError(one_of("--topic", given, found))
    if not found:
        others = ", ".join(sorted(types)) or "none"
        raise RecordingError(
            f"bag {bag} has no joint states: no topic is a {JOINT_STATE}; its topics: {others}"
        )
    for usual in (f"/{_USUAL_TOPIC}", _USUAL_TOPIC):
        if usual in found:
            return usual
    if len(found) > 1:
        raise RecordingError(
            f"bag {bag} has several topics of joint states; name one by --topic: {', '.join(found)}"
        )
    return found[0]


def _character_file(
    bag: Path, types: Mapping[str, str], source: RobotSource, topic: str
) -> tuple[CharacterFile, str]:
    """The file of the robot, as given or as the bag has it; and words on where it is from."""
    if source.character is not None:
        return read_character_file(source.character), ""
    folder = topic.rpartition("/")[0]
    described = sorted(
        (name for name in types if name.endswith(_DESCRIPTION) and types[name] == _TEXT),
        key=lambda name: (name != f"{folder}/{_DESCRIPTION}", name.count("/"), name),
    )
    for name in described:
        texts = [str(timed.content.data) for timed in read_timed(bag, name)]
        if texts:
            place = bag.absolute() / f"{_robot_name(texts[-1])}.urdf"
            return read_character_texts(place, "", place, texts[-1]), f", robot of '{name}'"
    raise RecordingError(
        f"bag {bag} is not of this project's simulator (nothing on '{CONFIGURATION}') and has no "
        f"'/{_DESCRIPTION}', so it does not say whose joints '{topic}' are; give the robot by "
        "--character ROBOT.urdf (or a shipped character's name)"
    )


def _robot_name(text: str) -> str:
    """The name that a URDF's text gives its robot, as far as it is one for a file."""
    try:
        name = files.parse_xml(Path(_DESCRIPTION), text, CharacterError).get("name", "")
    except CharacterError:
        name = ""
    return name if name.isidentifier() else _DESCRIPTION


def _build(file: CharacterFile) -> Character:
    """The character, if need be without what it collides with: nothing does in a recording."""
    try:
        return build_character(file)
    except CharacterError:
        return build_character(file, collides=False)


def _floating(file: CharacterFile) -> Character | None:
    """The character of a URDF alone with a base that moves, though it has no mass.

    None where its file says that it is fixed, or where the base is the world.
    """
    loading = file.loading
    robot = files.parse_xml(loading.urdf_path, loading.urdf_text, CharacterError)
    below = {joint.find("child") for joint in robot.findall("joint")}
    children = {child.get("link") for child in below if child is not None}
    base = next(link for link in robot.findall("link") if link.get("name") not in children)
    if file.text or base.get("name") == "world":
        return None
    for inertial in base.findall("inertial"):
        base.remove(inertial)
    inertial = ElementTree.SubElement(base, "inertial")
    ElementTree.SubElement(inertial, "mass", {"value": "1"})
    unit = {"ixx": "1", "iyy": "1", "izz": "1", "ixy": "0", "ixz": "0", "iyz": "0"}
    ElementTree.SubElement(inertial, "inertia", unit)
    text = ElementTree.tostring(robot, encoding="unicode")
    path = loading.urdf_path
    return _build(read_character_texts(path.with_suffix(".urdf"), "", path, text))


def _place_base(series: JointSeries, character: Character, motion: BaseMotion | None) -> str:
    """Put the base where it was; returns a remark on where that is from."""
    entries = character.layout.joint(ROOT).entries
    if motion is not None:
        poses = motion.at(series.stamps_ns, series.log_times_ns)
        series.position[:, entries] = np.hstack((poses[:, :3], rotations.log(poses[:, 3:])))
        return motion.remark
    if (series.position[:, entries] != np.array(character.rest_position)[entries]).any():
        return "the base is that of the joint states"
    return "nothing says where the base is; it stays where it rests"


def _recording(
    series: JointSeries, character: Character, topic: str, remarks: tuple[str, ...]
) -> RobotRecording:
    count, missing = len(series.stamps_ns), np.full_like(series.position, np.nan)
    return RobotRecording(
        character=character,
        parameters={},
        stamps_ns=series.stamps_ns,
        published_ns=series.published_ns,
        has_wall_times=series.has_wall_times,
        position=series.position,
        velocity=series.velocity,
        effort=series.effort[1:],
        reference_position=missing,
        reference_velocity=missing,
        contacts=(),
        applied_wrench=(),
        commands=((),) * count,
        topic=topic,
        remarks=remarks,
    )
