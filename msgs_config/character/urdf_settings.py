"""The keys of a character's YAML file that say which URDF is its body, and how that is read."""

from pathlib import Path

from msgs_config import files
from msgs_config.character.joints.joint_bounds import write_bounds
from msgs_config.character.mjcf_settings import MjcfFile
from msgs_config.character.model import UrdfOptions
from msgs_config.character.urdf.check import check_urdf
from msgs_config.character.urdf.file_formats.source import read_urdf_text
from msgs_config.character.urdf.frames import has_massless_base
from msgs_config.errors import CharacterError
from msgs_config.mappings import MappingReader

URDF_KEYS = (
    *("urdf", "xacro", "scale", "fixed_base", "inertia", "self_collision", "collision"),
    "joint_mimic",
)


def read_urdf_settings(
    path: Path,
    reader: MappingReader,
    joints: dict[str, MappingReader],
    known: tuple[Path, str] | None,
    mjcf: MjcfFile | None = None,
) -> tuple[UrdfOptions, tuple[str, ...]]:
    """How the URDF is to be read, and lines about its text.

    Args:
        path: The character's file.
        reader: Its content.
        joints: The parts of its key `joints`, by the joint's name.
        known: The URDF's path and its text, bounds and all, where the file there does not count.
        mjcf: What an MJCF says that is in the URDF's place.

    Raises:
        CharacterError: the URDF cannot be read or used; names its file, or the key.
    """
    misread = ""
    if known is not None:
        urdf, text = known
    elif mjcf is not None:
        urdf, text = mjcf.urdf, mjcf.urdf_text
    else:
        urdf = resolve_key(path, reader, "urdf")
        text, misread = read_urdf_text(urdf, _read_arguments(reader.part("xacro")))
    scale = reader.number("scale", default=1.0, minimum=1e-6)
    inertia = reader.choice("inertia", ["file", "shapes", "filled"])
    bounds = {
        name: (_read_bound(joint, "lower"), _read_bound(joint, "upper"))
        for name, joint in joints.items()
        if "lower" in joint.content or "upper" in joint.content
    }
    if bounds and known is None:
        check_urdf(urdf, text, limits=False)
        text = write_bounds(files.parse_xml(urdf, text, CharacterError), bounds, scale, path)
    robot = check_urdf(urdf, text)
    loading = UrdfOptions(
        urdf_path=urdf,
        urdf_text=text,
        scale=scale,
        fixed_base=reader.flag("fixed_base", default=has_massless_base(robot)),
        inertia_from_file=inertia != "shapes",
        fill_inertia=inertia == "filled",
        self_collision=reader.flag("self_collision"),
        collisions=reader.choice("collision", ["file", "none"]) == "file",
        mimics=reader.choice("joint_mimic", ["file", "none"]) == "file",
    )
    return loading, (misread,) if misread else ()


def _read_arguments(xacro: MappingReader) -> dict[str, str]:
    """The arguments of a xacro, as its texts have them."""
    texts = {}
    for name, value in xacro.content.items():
        if not isinstance(value, str | int | float):
            raise xacro.wrong(name, value, "a text, a number, true or false")
        texts[name] = str(value).lower() if isinstance(value, bool) else str(value)
    return texts


def _read_bound(joint: MappingReader, key: str) -> float | None:
    """The bound of a joint, rad or m; None if the file leaves the URDF's."""
    return joint.number(key) if key in joint.content else None


def resolve_key(path: Path, reader: MappingReader, key: str) -> Path:
    """The path under a key, which may be relative to the folder of the file that names it.

    Raises:
        CharacterError: it is no path, or in a package that is not installed; names the key.
    """
    text = reader.text(key)
    if "\0" in text:
        raise reader.wrong(key, text, "a path")
    try:
        return files.resolve(text, path.parent, CharacterError)
    except CharacterError as error:
        raise CharacterError(f"{path}: {key}: {error}") from error
