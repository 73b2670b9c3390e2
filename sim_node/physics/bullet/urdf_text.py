"""The text of a URDF as the engine reads it."""

from pathlib import Path
from xml.etree import ElementTree

from msgs_config.character.meshes.resolving import resolve_meshes
from msgs_config.character.meshes.triangles import file_for_engine
from msgs_config.character.model import UrdfOptions
from msgs_config.character.urdf.check import MAX_ELEMENT_BYTES, NUMBERS
from msgs_config.character.urdf.limits import WITH_BOUNDS
from msgs_config.character.urdf.repair import repair_urdf
from msgs_config.errors import CharacterError


def write_engine_urdf(loading: UrdfOptions, directory: Path) -> str:
    """A URDF's text for the engine: what moves and collides, in short lines, its meshes absolute.

    The engine would look for a mesh in the working directory first, take a tab between two
    numbers for an end, and read what is only seen, for nothing. Meshes that it cannot read are
    converted into files in the directory.

    Raises:
        CharacterError: a mesh does not exist or cannot be used, or an element is too long.
    """
    robot = resolve_meshes(loading).robot
    repair_urdf(robot, loading)
    for link in robot.findall("link"):
        unused = link.findall("visual")
        for part in unused if loading.collisions else unused + link.findall("collision"):
            link.remove(part)
    for element in robot.iter():
        for attribute in NUMBERS.get(element.tag, {}):
            if attribute in element.attrib:
                element.set(attribute, " ".join(element.attrib[attribute].split()))
    _convert_meshes(robot, loading.urdf_path, directory)
    _write_defaults(robot)
    ElementTree.indent(robot)
    text = ElementTree.tostring(robot, encoding="unicode")
    if any(len(line.encode()) > MAX_ELEMENT_BYTES for line in text.splitlines()):
        raise CharacterError(
            f"{loading.urdf_path}: an element of more than {MAX_ELEMENT_BYTES} bytes; "
            "the engine cannot read it"
        )
    return text


def _write_defaults(robot: ElementTree.Element) -> None:
    """Give each joint what ROS has for a number that is not there, where the engine differs."""
    for joint in robot.findall("joint"):
        for limit in joint.findall("limit"):
            lower, upper = limit.attrib.pop("lower", "0"), limit.attrib.pop("upper", "0")
            if joint.get("type") in WITH_BOUNDS:
                limit.attrib.update(lower=lower, upper=upper)
        for dynamics in joint.findall("dynamics"):
            dynamics.attrib.setdefault("damping", "0")


def _convert_meshes(robot: ElementTree.Element, urdf: Path, directory: Path) -> None:
    """Name files that the engine reads, each of which is checked or converted once."""
    files: dict[str, Path] = {}
    for mesh in robot.iterfind("link//mesh"):
        name = mesh.get("filename", "")
        try:
            if name not in files:
                files[name] = file_for_engine(Path(name), directory, f"mesh_{len(files)}")
        except CharacterError as error:
            raise CharacterError(f"{urdf}: {error}") from error
        mesh.set("filename", str(files[name]))
