"""A character's file whose body is an MJCF: the keys that the MJCF stands for are added to it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from msgs_config import files
from msgs_config.character.mjcf.compiling import is_mjcf
from msgs_config.errors import CharacterError

_KEY = "urdf"
_MERGED = ("joints", "sensors", "rest_pose")  # keys of which those of both files count
_HEAD = "# What this says beside its URDF was read from {name}, a model of MuJoCo.\n"


class MjcfFile(NamedTuple):
    """A character's file with what its MJCF says."""

    text: str
    """As YAML: with the URDF's text all that makes the character."""
    content: dict[str, Any]
    urdf: Path
    """The MJCF, which stands where a URDF would: meshes are looked for from there."""
    urdf_text: str
    remarks: tuple[str, ...]
    """A line for each kind of what does not count in the MJCF."""


def read_mjcf_file(path: Path, content: dict[str, Any], alone: dict[str, Any]) -> MjcfFile | None:
    """The file with the keys of the MJCF that it names, or that it is; None if that is a URDF.

    Where both say something, the file's own counts; of a file that is itself the MJCF `alone`.

    Raises:
        CharacterError: the MJCF cannot be used; names it.
    """
    name = content.get(_KEY)
    if not isinstance(name, str) or "\0" in name:
        return None
    try:
        urdf = files.resolve(name, path.parent, CharacterError)
        if not is_mjcf(urdf):
            return None
    except CharacterError:
        return None  # the URDF's reader says what is wrong with it
    from msgs_config.character.mjcf.reading import read_mjcf

    found = read_mjcf(urdf)
    own = alone if urdf == path else content
    merged = {_KEY: name, **found.content, **own}
    for key in _MERGED:
        given, others = own.get(key), found.content.get(key)
        if isinstance(given, dict) and isinstance(others, dict):
            merged[key] = _merge(others, given)
    left_out = own.get("left_out")
    kept = left_out if isinstance(left_out, list) else []
    remarks = tuple(each.line for each in found.remarks if each.kind not in kept)
    text = _HEAD.format(name=urdf.name) + files.dump_yaml(merged)
    return MjcfFile(text, merged, urdf, found.urdf_text, remarks)


def _merge(others: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Two mappings in one; where both have a mapping, the two of them in one likewise."""
    merged = {**others, **given}
    for name in others.keys() & given.keys():
        if isinstance(others[name], dict) and isinstance(given[name], dict):
            merged[name] = _merge(others[name], given[name])
    return merged
