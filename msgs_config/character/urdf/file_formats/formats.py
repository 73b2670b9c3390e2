"""Files that describe robots or their parts, but are no URDF: named as what they are."""

from pathlib import Path
from xml.etree import ElementTree

from msgs_config.errors import CharacterError
from msgs_config.file_kinds import describe_root

URDF_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf")
"""Of files that a URDF, or an MJCF in its place, may be in, in lower case."""
YAML_SUFFIXES = (".yaml", ".yml")

CHARACTER_FILE = (
    "a character, which is a .urdf, .xacro or .xml file, or a .yaml file that names one"
)
_XACRO_SPACE = "xacro"  # is in every address under which xacro's name space is declared


def is_urdf(path: Path) -> bool:
    """Whether a file's name is one of a URDF, not of a YAML file that names one."""
    return path.suffix.lower() in URDF_SUFFIXES


def check_root(path: Path, robot: ElementTree.Element) -> None:
    """Check that an XML file's root is that of a URDF, and that no xacro is left in it.

    Raises:
        CharacterError: it is not so; says what the file is.
    """
    if robot.tag != "robot":
        what, advice = describe_root(robot.tag)
        raise CharacterError(f"{path} is {what}, not {CHARACTER_FILE}; {advice}")
    found = _find_xacro(robot)
    if found:
        raise CharacterError(
            f"{path}: has {found[:100]}, which is xacro that was not expanded; the suffix .xacro "
            f"has it expanded here, as 'xacro {path.name} > expanded.urdf' does"
        )


def _find_xacro(robot: ElementTree.Element) -> str:
    """An element or a value of a URDF that xacro would have replaced; empty if there is none.

    What other programs read, within `<gazebo>` and the like, counts as well: it tells the same.
    """
    spaces = {name for name, value in robot.attrib.items() if _XACRO_SPACE in value}
    prefixes = {"xacro", *(name.partition(":")[2] for name in spaces if name.startswith("xmlns:"))}
    for element in robot.iter():
        if element.tag.partition(":")[0] in prefixes and ":" in element.tag:
            return f"<{element.tag}>"
    for part in (*robot.findall("link"), *robot.findall("joint")):
        for element in part.iter():
            for name, value in element.attrib.items():
                if "${" in value or "$(" in value:
                    return f"'{name}' of <{element.tag}> as '{value}'"
    old = robot.find("include")  # xacro's own, from before it had a prefix
    return "" if old is None else "<include>"
