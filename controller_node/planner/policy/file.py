"""A trained policy's file: a network, what it is told, what it answers, and what it was trained on.

An archive of numpy (`.npz`) without pickled objects. `about` is a JSON text: format, character,
its mass, clips, those by which it is steered (`gait`), rate, ticks of a decision, largest action,
gravity, what it expects while it is calm, what it was trained with and the figures that it was
accepted with; the arrays have the names of the fields of `Network`, `ObservationScales` and
`Policy`.
"""

import io
import json
import math
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller_node.planner.compiled.features import FeatureLayout
from controller_node.planner.compiled.network import Network
from controller_node.planner.compiled.observation import ObservationScales
from msgs_config.arrays import FloatArray, IntArray, SingleArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.whole_files import write_whole

SHIPPED = Path(__file__).parent / "shipped"
SUFFIX = ".npz"
STEERED = "steered"
"""The name among `clips` of what is steered; also that of its reference."""
_FORMAT = 1
_LARGEST_ARRAY = 80_000_000  # bytes
_ABOUT: Mapping[str, tuple[type | tuple[type, ...], str]] = {
    "character": (str, "a text"),
    "dofs": (list, "a list of names"),
    "clips": (list, "a list of names"),
    "rate": (int, "a whole number"),
    "hold": (int, "a whole number"),
    "largest": ((int, float), "a number"),
    "mass": ((int, float), "a number"),
    "gravity": ((int, float), "a number"),
    "calm": ((int, float), "a number"),
    "trained": (dict, "a mapping"),
    "figures": (dict, "a mapping"),
}
_NETWORK = tuple(f"policy.{name}" for name in Network._fields)
_VALUE = tuple(f"value.{name}" for name in Network._fields)
_SCALES = ("deviation", "frame_mean", "frame_scale")


@dataclass(frozen=True)
class Policy:
    """What a policy's file has."""

    about: Mapping[str, Any]
    network: Network  # observation to action
    value: Network  # observation to what is expected, 0 to 1
    scales: ObservationScales
    ahead: IntArray  # (frames,) ticks from now to the frames of the reference that it is told
    unit: FloatArray  # (a,) rad or m, offset of an action of one
    stiffness: FloatArray  # (n,) of the law that it was trained with
    damping: FloatArray  # (n,)

    @property
    def hold(self) -> int:
        """Ticks of a decision."""
        return int(self.about["hold"])

    @property
    def rate_hz(self) -> int:
        """Ticks a second."""
        return int(self.about["rate"])

    @property
    def calm(self) -> float:
        """What it expects at least while it is calm, but for a twentieth of its states."""
        return float(self.about["calm"])

    @property
    def largest(self) -> float:
        """Largest entry of an action."""
        return float(self.about["largest"])


def shipped_policies() -> list[str]:
    """The names of those that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob(f"*{SUFFIX}"))


def find_policy(name_or_path: str) -> Path:
    """The file of a policy, by its name or path."""
    if name_or_path in shipped_policies():
        return SHIPPED / (name_or_path + SUFFIX)
    with suppress(OSError, RuntimeError):  # a name too long, nobody's home
        path = Path(name_or_path).expanduser()
        if path.is_file():
            return path
    names = ", ".join(shipped_policies()) or "none"
    raise ConfigurationError(
        f"parameter 'policy' is '{name_or_path}'; it must be the path of a file of `train`, or one "
        f"of those that are shipped: {names}"
    )


def write_policy(path: Path, policy: Policy) -> None:
    """Write a policy's file, whole or not at all."""
    arrays: dict[str, Any] = dict(zip(_NETWORK, policy.network, strict=True))
    arrays |= dict(zip(_VALUE, policy.value, strict=True))
    arrays |= {name: getattr(policy.scales, name) for name in _SCALES}
    arrays |= {name: getattr(policy, name) for name in ("ahead", "unit", "stiffness", "damping")}
    about = json.dumps({**policy.about, "format": _FORMAT})
    content = io.BytesIO()
    np.savez_compressed(content, about=np.array(about), **arrays)
    write_whole(path, content.getvalue())


def read_policy(name_or_path: str, character: Character) -> Policy:
    """A policy for a character.

    Raises:
        ConfigurationError: there is none, it is malformed, or it is another character's.
    """
    path = find_policy(name_or_path)
    try:
        if not zipfile.is_zipfile(path):
            raise ValueError(f"it is no archive of numpy ({SUFFIX})")
        _check_size(path)
        with np.load(path, allow_pickle=False) as archive:
            content = {name: archive[name] for name in archive.files}
        policy = _policy(content, character)
    except Exception as error:  # numpy, its archives and JSON raise anything for what is not theirs
        reason = str(error) or type(error).__name__
        raise ConfigurationError(f"{path} is no policy's file of `train`: {reason}") from error
    _check_character(path, policy, character)
    return policy


def _check_size(path: Path) -> None:
    """Raise ValueError if the archive is larger than any policy's, before anything is unpacked."""
    with zipfile.ZipFile(path) as archive:
        size = max((entry.file_size for entry in archive.infolist()), default=0)
    if size > _LARGEST_ARRAY:
        raise ValueError(f"it has an array of {size:,} bytes; {_LARGEST_ARRAY:,} is the most")


def _policy(content: Mapping[str, Any], character: Character) -> Policy:
    about = _read_about(content)
    mean = _array(content, "frame_mean", float, 2)
    deviation, scale = (
        _array(content, "deviation", float, 1),
        _array(content, "frame_scale", float, 2),
    )
    if min(deviation.min(initial=1.0), scale.min(initial=1.0)) <= 0.0:
        raise ValueError("'deviation' and 'frame_scale' must be above 0")
    ahead = _array(content, "ahead", np.intp, 1)
    if ahead[:1].tolist() != [0] or not (np.diff(ahead) > 0).all():
        raise ValueError("'ahead' must rise from 0 on")
    return Policy(
        about,
        _network(content, _NETWORK),
        _network(content, _VALUE),
        ObservationScales(deviation, mean, scale, _layout(character).centre),
        ahead,
        *(_array(content, name, float, 1) for name in ("unit", "stiffness", "damping")),
    )


def _read_about(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """What is said of a policy, checked."""
    about = json.loads(str(_found(content, "about")))
    if not isinstance(about, dict):
        raise ValueError("'about' must be a mapping")
    if about.get("format") != _FORMAT:
        raise ValueError(f"its format is {about.get('format')!r}; this version reads {_FORMAT}")
    for name, (kind, words) in _ABOUT.items():
        if not isinstance(about.get(name), kind):
            raise ValueError(f"'{name}' in 'about' must be {words}")
    for names in ("dofs", "clips", "gait"):
        named = about.get(names, [])
        if not isinstance(named, list) or not all(isinstance(name, str) for name in named):
            raise ValueError(f"'{names}' in 'about' must be a list of names")
    for name in ("decisions", "pushes_ns"):
        number = about["trained"].get(name, 0)
        if not isinstance(number, int | float) or not 0 <= number < math.inf:
            raise ValueError(f"'{name}' of 'trained' in 'about' must be a number, 0 or more")
    if min(about["hold"], about["rate"]) < 1 or not 0.0 < about["largest"] < math.inf:
        raise ValueError("'hold', 'rate' and 'largest' in 'about' must be above 0, and finite")
    if not 0.0 < about["mass"] < math.inf or not 0.0 <= about["gravity"] < math.inf:
        raise ValueError("'mass' in 'about' must be above 0, 'gravity' at least 0, both finite")
    if not 0.0 < about["calm"] < math.inf:
        raise ValueError("'calm' in 'about' must be above 0, and finite")
    return about


def _layout(character: Character) -> FeatureLayout:
    """That of `ContactModel.feature_layout`, without building the model."""
    return FeatureLayout(character.layout.size - 6, len(character.end_effectors))


def _found(content: Mapping[str, Any], name: str) -> Any:
    if name not in content:
        raise ValueError(f"it has no '{name}'")
    return content[name]


def _array(content: Mapping[str, Any], name: str, kind: Any, dimensions: int) -> Any:
    array = _found(content, name)
    if not isinstance(array, np.ndarray):
        raise ValueError(f"'{name}' is no array")
    kinds = "iu" if kind is np.intp else "iuf"
    if array.ndim != dimensions or array.dtype.kind not in kinds:
        raise ValueError(
            f"'{name}' is {array.dtype} of shape {array.shape}; it must be {np.dtype(kind)}, its "
            f"dimensions {dimensions}"
        )
    with np.errstate(over="ignore"):
        converted = np.ascontiguousarray(array, dtype=kind)
    if not np.isfinite(converted).all():
        raise ValueError(f"'{name}' has entries that are not finite")
    return converted


def _network(content: Mapping[str, Any], names: tuple[str, ...]) -> Network:
    arrays: list[SingleArray] = [
        _array(content, name, np.float32, 2 - number % 2) for number, name in enumerate(names)
    ]
    width = arrays[0].shape[0]
    for weights, bias in zip(arrays[::2], arrays[1::2], strict=True):
        if weights.shape != (width, len(bias)):
            raise ValueError(f"'{names[0]}' and those after it do not fit each other")
        width = len(bias)
    return Network(*arrays)


def _check_character(path: Path, policy: Policy, character: Character) -> None:
    """Raise ConfigurationError if shapes or names are not the character's."""
    layout, about = character.layout, policy.about
    features, frame = _layout(character).size, _layout(character).frame_size
    shapes = {
        "dofs": (list(about["dofs"]), list(layout.dof_names)),
        "deviation": (policy.scales.deviation.shape, (features,)),
        "frame_mean": (policy.scales.frame_mean.shape, (len(policy.ahead), frame)),
        "frame_scale": (policy.scales.frame_scale.shape, (len(policy.ahead), frame)),
        "unit": (policy.unit.shape, (layout.size - 6,)),
        "stiffness": (policy.stiffness.shape, (layout.size,)),
        "damping": (policy.damping.shape, (layout.size,)),
        "policy": (_ends(policy.network), (features + policy.ahead.size * frame, layout.size - 6)),
        "value": (_ends(policy.value), (features + policy.ahead.size * frame, 1)),
    }
    if any(found != wanted for found, wanted in shapes.values()):
        wrong = next(name for name, (found, wanted) in shapes.items() if found != wanted)
        raise ConfigurationError(
            f"{path} is a policy of the character '{about['character']}', and does not fit "
            f"'{character.name}' (its '{wrong}')"
        )


def _ends(network: Network) -> tuple[int, int]:
    return len(network.weights_1), len(network.bias_3)
