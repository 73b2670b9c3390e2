"""Files that describe robots or their parts, but are no URDF: named as what they are."""

from pathlib import Path
from xml.etree import ElementTree

from msgs_config.errors import CharacterError

URDF_SUFFIXES = (".urdf", ".xacro", ".xml")
"""Of files that a URDF may be in, in lower case."""
YAML_SUFFIXES = (".yaml", ".yml")

_REMEDY = "a character is a .urdf or .xacro file, or a .yaml file that names one"
_MESH = f"a mesh, which a URDF can name in <mesh>; {_REMEDY}"
_MODEL = f"a model; {_REMEDY}"
_USD = f"USD, a scene of Omniverse or Isaac Sim; {_REMEDY}: robots in USD come from one as a rule"
_SDF = f"SDF, Gazebo's format of models and worlds; {_REMEDY}"
_MJCF = f"MJCF, MuJoCo's format; {_REMEDY}"
_DATA = f"data, and no robot; {_REMEDY}"
_BY_SUFFIX = {
    ".sdf": _SDF,
    ".world": _SDF,
    ".mjcf": _MJCF,
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _USD),
    ".srdf": f"SRDF, what MoveIt adds to a URDF; {_REMEDY}",
    ".proto": f"PROTO, Webots' format; {_REMEDY}",
    **dict.fromkeys((".stl", ".obj", ".dae", ".glb", ".gltf", ".ply", ".fbx"), _MESH),
    **dict.fromkeys((".step", ".stp", ".sldasm", ".blend"), _MODEL),
    **dict.fromkeys((".npz", ".npy", ".csv", ".json", ".pkl", ".pt"), _DATA),
    **dict.fromkeys((".mcap", ".db3"), f"a recording; {_REMEDY}"),
    ".bvh": f"captured motion: 'motion import' makes a clip of it; {_REMEDY}",
}
_BY_ROOT = {
    "sdf": _SDF,
    "world": _SDF,
    "model": _SDF,
    "gazebo": _SDF,
    "mujoco": _MJCF,
    "mujocoinclude": _MJCF,
    "COLLADA": _MESH,
    "package": f"a ROS package's description; {_REMEDY}",
    "launch": f"a launch file; {_REMEDY}",
    "html": f"a web page, not the file itself; {_REMEDY}",
}
_XACRO_SPACE = "xacro"  # is in every address under which xacro's name space is declared


def is_urdf(path: Path) -> bool:
    """Whether a file's name is one of a URDF, not of a YAML file that names one."""
    return path.suffix.lower() in URDF_SUFFIXES


def check_suffix(path: Path) -> None:
    """Raise CharacterError for a file that is no character by its name; says what it is."""
    what = _BY_SUFFIX.get(path.suffix.lower())
    if what is not None:
        raise CharacterError(f"{path} is {what}")


def check_root(path: Path, robot: ElementTree.Element) -> None:
    """Check that an XML file's root is that of a URDF, and that no xacro is left in it.

    Raises:
        CharacterError: it is not so; says what the file is.
    """
    if robot.tag != "robot":
        what = _BY_ROOT.get(robot.tag, f"XML whose root is <{robot.tag[:100]}>; {_REMEDY}")
        raise CharacterError(f"{path} is {what}")
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
