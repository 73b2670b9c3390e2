"""The YAML file of a character, checked key by key."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgs_config import files
from msgs_config.character.mjcf_settings import read_mjcf_file
from msgs_config.character.model import ClipFormat, Gains, Planning, SoftLimit, UrdfOptions, Vector
from msgs_config.character.sensors import Sensor, read_sensors
from msgs_config.character.urdf.file_formats.formats import (
    CHARACTER_FILE,
    URDF_SUFFIXES,
    YAML_SUFFIXES,
    is_urdf,
)
from msgs_config.character.urdf_settings import URDF_KEYS, read_urdf_settings, resolve_key
from msgs_config.errors import CharacterError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.mappings import LARGEST, MappingReader

CHARACTERS_DIRECTORY = Path(__file__).parent / "data"

_LEAST_SIGMA = 1e-6  # rad or m
_LARGEST_FREQUENCY = 50.0  # Hz; at 240 ticks a second stable PD is stable below it
AUTOMATIC_GAINS_HZ = 5.0
"""Of a URDF alone: a joint sags by g / (length w^2), which for 0.5 m is 0.02 rad."""
_NO_GAINS = Gains()
_GAIN_KEYS = ("stiffness", "damping", "integral")
_PASSIVE_KEYS = ("passive_damping", "friction", "soft_limit")
_JOINT_KEYS = (*_GAIN_KEYS, "effort_limit", "lower", "upper", *_PASSIVE_KEYS)
_CLIP_KEYS = ("files", "joints", "up_axis", "quaternion", "base_rotation", "signs", "offsets")
_POSE_KEYS = (
    *("joint_damping", "joint_friction", "rest_pose", "on_ground", "joints", "automatic_gains"),
)
_OTHER_KEYS = ("root_assistance", "root_armature", "clips", "feet", "planner", "sensors")
_KEYS = (*URDF_KEYS, "left_out", "up_axis", *_POSE_KEYS, *_OTHER_KEYS)
ALONE: dict[str, Any] = {
    "inertia": "filled",
    "on_ground": True,
    "automatic_gains": AUTOMATIC_GAINS_HZ,
}
"""The keys of a URDF alone; all others have their defaults."""
_MJCF_ALONE = {key: ALONE[key] for key in ("on_ground", "automatic_gains")}


@dataclass(frozen=True)
class CharacterFile:
    """The content of a character's YAML file; of a URDF alone, that of `ALONE`."""

    name: str
    path: Path
    text: str
    loading: UrdfOptions
    up_axis: str
    rest_pose: dict[str, float]  # DoF name -> m or rad
    on_ground: bool  # whether a floating base is put so high that the lowest point is at z = 0
    automatic_gains: float  # Hz at which joints without gains are damped critically; 0: limp
    gains: dict[str, Gains]  # joint name -> gains; `force` and `torque` of the root assistance
    effort_limits: dict[str, float]  # joint name -> N m or N
    urdf_damping: bool  # whether the URDF's passive damping of hinges and sliders counts
    passive_damping: dict[str, float]  # joint name -> N m s/rad or N s/m
    urdf_friction: bool  # whether the URDF's friction of hinges and sliders counts
    friction: dict[str, float]  # joint name -> N m or N
    soft_limits: dict[str, SoftLimit]  # ball joint name -> its limit
    assistance: dict[str, Gains]
    root_armature: float  # of a floating base, kg and kg m^2
    clips: ClipFormat
    feet: tuple[str, ...]
    planning: Planning
    sensors: tuple[Sensor, ...]
    # Kinds of what does not count in the URDF of which no line is printed.
    left_out: frozenset[str]
    misread: tuple[str, ...]  # lines about a text that is not in its encoding, or no URDF


def shipped_characters() -> list[str]:
    """Names of the characters that come with the package."""
    return sorted(path.stem for path in CHARACTERS_DIRECTORY.glob("*.yaml"))


def character_path(name_or_path: str) -> Path:
    """The file of a shipped character, or that of a path to a YAML file or a URDF.

    A path may be relative to the working directory, absolute, or `package://NAME/...`; its suffix
    is `.yaml`, `.urdf`, `.xacro` or `.xml`, in capitals or not.

    Raises:
        CharacterError: there is no such character or package, or the file is of another format.
    """
    if name_or_path.lower().endswith((*YAML_SUFFIXES, *URDF_SUFFIXES)):
        path = files.resolve(name_or_path, Path.cwd(), CharacterError)
    elif name_or_path in shipped_characters():
        path = CHARACTERS_DIRECTORY / f"{name_or_path}.yaml"
    else:
        kinds = (*YAML_SUFFIXES, *URDF_SUFFIXES)
        refuse_other_kind(Path(name_or_path), CHARACTER_FILE, kinds, CharacterError)
        sentence = one_of("character", name_or_path, shipped_characters())
        raise CharacterError(f"{sentence}, or the path of a .yaml, .urdf, .xacro or .xml file")
    return path


def read_character_file(name_or_path: str) -> CharacterFile:
    """Read and check a character's file, and the URDF that it names.

    Raises:
        CharacterError: names the file, the key and what would be right.
    """
    path = character_path(name_or_path)
    return _parse(path, "" if is_urdf(path) else files.read_text(path, CharacterError), None)


def read_character_texts(path: Path, text: str, urdf: Path, urdf_text: str) -> CharacterFile:
    """A character's file from the texts that it once had; `text` is empty for a URDF alone.

    `urdf_text` is that of `UrdfOptions`, with the bounds of the character's file in it. `path` and
    `urdf` are where the two lay; of what lies there now, only the meshes are read.

    Raises:
        CharacterError: names the file, the key and what would be right.
    """
    return _parse(path, text, (urdf, urdf_text))


def _parse(path: Path, text: str, urdf: tuple[Path, str] | None) -> CharacterFile:
    content: dict[str, Any] = {"urdf": path.name, **ALONE}
    if text or not is_urdf(path):
        content = files.parse_yaml_mapping(path, text, CharacterError)
    mjcf = read_mjcf_file(path, content, _MJCF_ALONE) if urdf is None else None
    if mjcf is not None:
        text, content = mjcf.text, mjcf.content
    reader = MappingReader(path, content, CharacterError)
    reader.check_keys(_KEYS)
    joints = reader.parts("joints", _JOINT_KEYS)
    reader.part("root_assistance").check_keys(["force", "torque"])
    assistance = reader.parts("root_assistance", _GAIN_KEYS)
    rest_pose = reader.part("rest_pose")
    loading, misread = read_urdf_settings(path, reader, joints, urdf, mjcf)
    return CharacterFile(
        name=_name(path),
        path=path,
        text=text,
        loading=loading,
        up_axis=reader.choice("up_axis", ["z", "y"]),
        rest_pose={name: rest_pose.number(name) for name in rest_pose.content},
        on_ground=reader.flag("on_ground"),
        automatic_gains=_read_frequency(reader),
        gains={name: _read_gains(joint) for name, joint in joints.items()},
        effort_limits=_read_numbers(joints, "effort_limit"),
        urdf_damping=reader.choice("joint_damping", ["file", "none"]) == "file",
        passive_damping=_read_numbers(joints, "passive_damping"),
        urdf_friction=reader.choice("joint_friction", ["file", "none"]) == "file",
        friction=_read_numbers(joints, "friction"),
        soft_limits={
            name: _read_soft_limit(joint.part("soft_limit"))
            for name, joint in joints.items()
            if "soft_limit" in joint.content
        },
        assistance={name: _read_gains(part) for name, part in assistance.items()},
        root_armature=reader.number("root_armature", default=0.0, minimum=0.0),
        clips=_read_clip_format(path, reader.part("clips")),
        feet=reader.names("feet", "links", default=[]),
        planning=_read_planning(reader.part("planner"), joints),
        sensors=read_sensors(reader.part("sensors")),
        left_out=frozenset(reader.names("left_out", "elements and attributes", default=[])),
        misread=(*misread, *(() if mjcf is None else mjcf.remarks)),
    )


def _name(path: Path) -> str:
    """The name of a file's character: that of `robot.urdf.xacro` is `robot`."""
    return Path(path.stem).stem if Path(path.stem).suffix.lower() == ".urdf" else path.stem


def _read_numbers(joints: dict[str, MappingReader], key: str) -> dict[str, float]:
    """The number of each joint that has this key, by the joint's name."""
    return {
        name: joint.number(key, minimum=0.0)
        for name, joint in joints.items()
        if key in joint.content
    }


def _read_gains(reader: MappingReader, default: Gains = _NO_GAINS) -> Gains:
    return Gains(
        stiffness=reader.number("stiffness", default.stiffness, minimum=0.0),
        damping=reader.number("damping", default.damping, minimum=0.0),
        integral=reader.number("integral", default.integral, minimum=0.0),
    )


def _read_frequency(reader: MappingReader) -> float:
    """The frequency of automatic gains, Hz; 0 without them."""
    frequency = reader.number("automatic_gains", default=0.0, minimum=0.0)
    if frequency > _LARGEST_FREQUENCY:
        raise reader.wrong(
            "automatic_gains", frequency, f"a frequency of at most {_LARGEST_FREQUENCY:g} Hz"
        )
    return frequency


def _read_angles(reader: MappingReader, key: str, default: list[float] | None = None) -> Vector:
    x, y, z = reader.numbers(key, 3, (-math.pi, math.pi), default)
    return (x, y, z)


def _read_soft_limit(limit: MappingReader) -> SoftLimit:
    limit.check_keys(["lower", "upper", "stiffness", "damping"])
    lower, upper = _read_angles(limit, "lower"), _read_angles(limit, "upper")
    if any(low > high for low, high in zip(lower, upper, strict=True)):
        raise limit.wrong("lower", list(lower), "nowhere above 'upper'")
    return SoftLimit(
        lower,
        upper,
        stiffness=limit.number("stiffness", minimum=0.0),
        damping=limit.number("damping", default=0.0, minimum=0.0),
    )


def _read_clip_format(path: Path, clips: MappingReader) -> ClipFormat:
    if not clips.content:
        return ClipFormat()
    clips.check_keys(_CLIP_KEYS)
    pattern = resolve_key(path, clips, "files")
    if pattern.name.count("*") != 1:
        raise clips.wrong("files", pattern.name, "a path with one '*'")
    signs, offsets = clips.part("signs"), clips.part("offsets")
    for name, sign in signs.content.items():
        if sign not in (1, -1):
            raise signs.wrong(name, sign, "1 or -1")
    return ClipFormat(
        str(pattern),
        clips.names("joints", "joint names"),
        clips.choice("up_axis", ["z", "y"]),
        clips.choice("quaternion", ["wxyz", "xyzw"]),
        _read_angles(clips, "base_rotation", default=[0.0, 0.0, 0.0]),
        {name: signs.number(name) for name in signs.content},
        {name: offsets.number(name) for name in offsets.content},
    )


def _read_planning(planner: MappingReader, joints: dict[str, MappingReader]) -> Planning:
    """The settings of the planner; a gain that it leaves out is that of `joints`."""
    planner.check_keys(["sigma", "gains"])
    sigma, gains = planner.part("sigma"), planner.parts("gains", _GAIN_KEYS)
    return Planning(
        {name: _read_sigma(sigma, name) for name in sigma.content},
        {
            name: _read_gains(part, _read_gains(joints[name]) if name in joints else _NO_GAINS)
            for name, part in gains.items()
        },
    )


def _read_sigma(sigma: MappingReader, name: str) -> float | Vector:
    """A positive number, or three of them."""
    if not isinstance(sigma.content[name], list):
        return sigma.number(name, minimum=_LEAST_SIGMA)
    x, y, z = sigma.numbers(name, 3, (_LEAST_SIGMA, LARGEST))
    return (x, y, z)
