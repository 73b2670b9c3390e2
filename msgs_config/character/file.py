"""The YAML file of a character, checked key by key."""

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgs_config import files
from msgs_config.character.joint_bounds import with_bounds
from msgs_config.character.model import ClipFormat, Gains, Planning, SoftLimit, UrdfOptions, Vector
from msgs_config.character.urdf_check import check_urdf, has_world_base
from msgs_config.errors import CharacterError, one_of

CHARACTERS_DIRECTORY = Path(__file__).parent / "data"

_LARGEST = sys.float_info.max
_SHOWN = 200  # characters
_LEAST_SIGMA = 1e-6  # rad or m
_NO_GAINS = Gains()
_KEYS = [
    "urdf",
    "scale",
    "up_axis",
    "fixed_base",
    "inertia",
    "self_collision",
    "joint_damping",
    "rest_pose",
    "joints",
    "root_assistance",
    "clips",
    "feet",
    "planner",
]
_JOINT_KEYS = [
    "stiffness",
    "damping",
    "integral",
    "effort_limit",
    "lower",
    "upper",
    "passive_damping",
    "soft_limit",
]


@dataclass(frozen=True)
class CharacterFile:
    """The content of a character's YAML file; of a URDF alone, all keys at their defaults."""

    name: str
    path: Path
    text: str
    loading: UrdfOptions
    up_axis: str
    rest_pose: dict[str, float]  # DoF name -> m or rad
    gains: dict[str, Gains]  # joint name -> gains; `force` and `torque` of the root assistance
    effort_limits: dict[str, float]  # joint name -> N m or N
    urdf_damping: bool  # whether the URDF's passive damping of hinges and sliders counts
    passive_damping: dict[str, float]  # joint name -> N m s/rad or N s/m
    soft_limits: dict[str, SoftLimit]  # ball joint name -> its limit
    assistance: dict[str, Gains]
    clips: ClipFormat
    feet: tuple[str, ...]
    planning: Planning


def shipped_characters() -> list[str]:
    """Names of the characters that come with the package."""
    return sorted(path.stem for path in CHARACTERS_DIRECTORY.glob("*.yaml"))


def character_path(name_or_path: str) -> Path:
    """The file of a shipped character, or the one of a path that ends in `.yaml` or `.urdf`.

    A path may be relative to the working directory, absolute, or `package://NAME/...`.

    Raises:
        CharacterError: there is no such character or package.
    """
    if name_or_path.endswith((".yaml", ".yml", ".urdf")):
        path = files.resolve(name_or_path, Path.cwd(), CharacterError)
    elif name_or_path in shipped_characters():
        path = CHARACTERS_DIRECTORY / f"{name_or_path}.yaml"
    else:
        sentence = one_of("character", name_or_path, shipped_characters())
        raise CharacterError(f"{sentence}, or the path of a .yaml or .urdf file")
    return path


def read_character_file(name_or_path: str) -> CharacterFile:
    """Read and check a character's file, and the URDF that it names.

    Raises:
        CharacterError: names the file, the key and what would be right.
    """
    path = character_path(name_or_path)
    alone = path.suffix == ".urdf"
    return _parse(path, "" if alone else files.read_text(path, CharacterError), None)


def read_character_texts(path: Path, text: str, urdf: Path, urdf_text: str) -> CharacterFile:
    """A character's file from the texts that it once had; `text` is empty for a URDF alone.

    `urdf_text` is that of `UrdfOptions`, with the bounds of the character's file in it. `path` and
    `urdf` are where the two lay; of what lies there now, only the meshes are read.

    Raises:
        CharacterError: names the file, the key and what would be right.
    """
    return _parse(path, text, (urdf, urdf_text))


def _parse(path: Path, text: str, urdf: tuple[Path, str] | None) -> CharacterFile:
    content: dict[str, Any] = {"urdf": path.name}
    if text or path.suffix != ".urdf":
        content = files.parse_yaml_mapping(path, text, CharacterError)
    reader = _Reader(path, content)
    reader.check_keys(_KEYS)
    joints = reader.parts("joints")
    for joint in joints.values():
        joint.check_keys(_JOINT_KEYS)
    assistance = reader.part("root_assistance")
    assistance.check_keys(["force", "torque"])
    rest_pose = reader.part("rest_pose")
    return CharacterFile(
        name=path.stem,
        path=path,
        text=text,
        loading=_loading(reader, joints, urdf),
        up_axis=reader.choice("up_axis", ["z", "y"]),
        rest_pose={name: rest_pose.number(name) for name in rest_pose.content},
        gains={name: joint.gains() for name, joint in joints.items()},
        effort_limits=_numbers(joints, "effort_limit"),
        urdf_damping=reader.choice("joint_damping", ["file", "none"]) == "file",
        passive_damping=_numbers(joints, "passive_damping"),
        soft_limits={
            name: _soft_limit(joint.part("soft_limit"))
            for name, joint in joints.items()
            if "soft_limit" in joint.content
        },
        assistance={name: part.gains() for name, part in reader.parts("root_assistance").items()},
        clips=_clip_format(reader.part("clips")),
        feet=tuple(reader.names("feet", "links", default=[])),
        planning=_planning(reader.part("planner"), joints),
    )


def _loading(
    reader: "_Reader", joints: dict[str, "_Reader"], known: tuple[Path, str] | None
) -> UrdfOptions:
    """How the URDF is to be read; `known` are its path and its text, bounds and all."""
    if known is None:
        urdf = reader.path_of("urdf")
        text = files.read_text(urdf, CharacterError)
    else:
        urdf, text = known
    robot = check_urdf(urdf, text)
    scale = reader.number("scale", default=1.0, minimum=1e-6)
    bounds = {
        name: (joint.number_or_none("lower"), joint.number_or_none("upper"))
        for name, joint in joints.items()
        if {"lower", "upper"} & set(joint.content)
    }
    return UrdfOptions(
        urdf_path=urdf,
        urdf_text=text if known or not bounds else with_bounds(robot, bounds, scale, reader.file),
        scale=scale,
        fixed_base=reader.flag("fixed_base", default=has_world_base(robot)),
        inertia_from_file=reader.choice("inertia", ["file", "shapes"]) == "file",
        self_collision=reader.flag("self_collision"),
    )


def _numbers(joints: dict[str, "_Reader"], key: str) -> dict[str, float]:
    """The number of each joint that has this key, by the joint's name."""
    return {
        name: joint.number(key, minimum=0.0)
        for name, joint in joints.items()
        if key in joint.content
    }


def _soft_limit(limit: "_Reader") -> SoftLimit:
    limit.check_keys(["lower", "upper", "stiffness", "damping"])
    lower, upper = limit.angles("lower"), limit.angles("upper")
    if any(low > high for low, high in zip(lower, upper, strict=True)):
        raise limit.wrong("lower", list(lower), "nowhere above 'upper'")
    return SoftLimit(
        lower,
        upper,
        stiffness=limit.number("stiffness", minimum=0.0),
        damping=limit.number("damping", default=0.0, minimum=0.0),
    )


def _clip_format(clips: "_Reader") -> ClipFormat:
    if not clips.content:
        return ClipFormat()
    clips.check_keys(
        ["files", "joints", "up_axis", "quaternion", "base_rotation", "signs", "offsets"]
    )
    joints = clips.names("joints", "joint names", default=None)
    pattern = clips.path_of("files")
    if pattern.name.count("*") != 1:
        raise clips.wrong("files", pattern.name, "a path with one '*'")
    signs, offsets = clips.part("signs"), clips.part("offsets")
    for name, sign in signs.content.items():
        if sign not in (1, -1):
            raise signs.wrong(name, sign, "1 or -1")
    return ClipFormat(
        str(pattern),
        tuple(joints),
        clips.choice("up_axis", ["z", "y"]),
        clips.choice("quaternion", ["wxyz", "xyzw"]),
        clips.angles("base_rotation", default=[0.0, 0.0, 0.0]),
        {name: signs.number(name) for name in signs.content},
        {name: offsets.number(name) for name in offsets.content},
    )


def _planning(planner: "_Reader", joints: dict[str, "_Reader"]) -> Planning:
    """What is said for the planner; a gain that it leaves out is that of `joints`."""
    planner.check_keys(["sigma", "gains"])
    sigma, gains = planner.part("sigma"), planner.parts("gains")
    for part in gains.values():
        part.check_keys(["stiffness", "damping", "integral"])
    return Planning(
        {name: sigma.sigma(name) for name in sigma.content},
        {
            name: part.gains(joints[name].gains() if name in joints else Gains())
            for name, part in gains.items()
        },
    )


class _Reader:
    """Takes typed values out of a mapping, with errors that name file, key and value."""

    def __init__(self, file: Path, content: dict[str, Any], prefix: str = "") -> None:
        self.content = content
        self.file = file
        self._prefix = prefix  # the keys that lead to this mapping, such as `joints.chest.`

    def wrong(self, key: str, value: object, right: str) -> CharacterError:
        return CharacterError(
            f"{self.file}: {self._prefix}{key} is {_shown(value)}; it must be {right}"
        )

    def check_keys(self, known: list[str]) -> None:
        for key in self.content:
            if key not in known:
                sentence = one_of("key", f"{self._prefix}{key}", known)
                raise CharacterError(f"{self.file}: {sentence}")

    def part(self, key: str) -> "_Reader":
        """The mapping under a key; one that is absent is empty."""
        value = self.content.get(key)
        value = {} if value is None else value
        if not isinstance(value, dict) or not all(isinstance(name, str) for name in value):
            raise self.wrong(key, value, "a mapping")
        return _Reader(self.file, value, f"{self._prefix}{key}.")

    def parts(self, key: str) -> dict[str, "_Reader"]:
        """The mappings in the mapping under a key."""
        part = self.part(key)
        return {name: part.part(name) for name in part.content}

    def text(self, key: str) -> str:
        value = self.content.get(key)
        if not isinstance(value, str) or not value:
            raise self.wrong(key, value, "a text")
        return value

    def path_of(self, key: str) -> Path:
        text = self.text(key)
        if "\0" in text:
            raise self.wrong(key, text, "a path")
        try:
            return files.resolve(text, self.file.parent, CharacterError)
        except CharacterError as error:
            raise CharacterError(f"{self.file}: {self._prefix}{key}: {error}") from error

    def choice(self, key: str, choices: list[str]) -> str:
        value = self.content.get(key, choices[0])
        if value not in choices:
            raise self.wrong(key, value, " or ".join(f"'{choice}'" for choice in choices))
        return str(value)

    def flag(self, key: str, default: bool = False) -> bool:
        value = self.content.get(key, default)
        if not isinstance(value, bool):
            raise self.wrong(key, value, "true or false")
        return value

    def number(self, key: str, default: float | None = None, minimum: float = -_LARGEST) -> float:
        value: Any = self.content.get(key, default)
        # compared, not converted: a whole number may be larger than every float
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if is_number and minimum <= value <= _LARGEST:
            return float(value)
        bound = "" if minimum == -_LARGEST else f" of at least {minimum:g}"
        raise self.wrong(key, value, f"a finite number{bound}")

    def number_or_none(self, key: str) -> float | None:
        """The number of a key that may be absent."""
        return self.number(key) if key in self.content else None

    def angles(self, key: str, default: list[float] | None = None) -> Vector:
        """Three angles in rad from -pi to pi; without a default they must be there."""
        value = self.content.get(key, default)
        right = "a list of three numbers from -pi to pi"
        if not isinstance(value, list) or len(value) != 3:
            raise self.wrong(key, value, right)
        for item in value:
            is_number = isinstance(item, (int, float)) and not isinstance(item, bool)
            if not (is_number and abs(item) <= math.pi):  # NaN is not
                raise self.wrong(key, value, right)
        x, y, z = (float(item) for item in value)
        return (x, y, z)

    def names(self, key: str, what: str, default: list[str] | None) -> list[str]:
        """A list of names; without a default it must be there."""
        value = self.content.get(key, default)
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise self.wrong(key, value, f"a list of {what}")
        return value

    def sigma(self, key: str) -> float | Vector:
        """A positive number, or three of them."""
        value = self.content.get(key)
        if not isinstance(value, list):
            return self.number(key, minimum=_LEAST_SIGMA)
        if len(value) != 3:
            raise self.wrong(key, value, "a number or a list of three")
        parts = {f"{key}[{index}]": item for index, item in enumerate(value)}
        numbers = _Reader(self.file, parts, self._prefix)
        x, y, z = (numbers.number(part, minimum=_LEAST_SIGMA) for part in parts)
        return (x, y, z)

    def gains(self, default: Gains = _NO_GAINS) -> Gains:
        return Gains(
            stiffness=self.number("stiffness", default=default.stiffness, minimum=0.0),
            damping=self.number("damping", default=default.damping, minimum=0.0),
            integral=self.number("integral", default=default.integral, minimum=0.0),
        )


def _shown(value: object) -> str:
    """A value as an error shows it: a few lines of YAML can stand for millions of entries."""
    if isinstance(value, (list, dict)):
        return f"a {type(value).__name__}"
    if isinstance(value, int) and abs(value) > _LARGEST:
        return "a number of too many digits"
    return repr(value)[:_SHOWN]
