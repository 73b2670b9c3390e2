"""Says what a file is that is given where another one belongs, and what can be done with it."""

import re
from collections.abc import Collection
from pathlib import Path

from msgs_config.errors import ActuatedCharactersError
from msgs_config.files import LFS_POINTER, LFS_REMEDY

_ROS_1 = b"#ROSBAG V"
_SIGNATURES = {  # how files begin, whatever their names are
    _ROS_1: ".bag",
    b"Kaydara FBX Binary": ".fbx",
    b"; FBX": ".fbx",
    b"glTF": ".glb",
    b"PK\x03\x04": ".npz",
    b"\x93NUMPY": ".npy",
    b"BLENDER": ".blend",
}
_ROOT = re.compile(rb"<(?![?!])([A-Za-z][\w.:-]*)")
_COMMENT = re.compile(rb"<!--.*?(-->|\Z)", re.DOTALL)
_READ_BYTES = 4096  # bytes of a file's beginning

_CHARACTER = "a robot goes where a character does: --character"
_SCENE = "Blender makes a .bvh of its motion, which 'motion import' reads"
_IMPORT = "'actuated_characters motion import' makes a clip of it"
_AS_BVH = f"as a .bvh file {_IMPORT}"
_NONE_HERE = "no command reads it"
_UNPACK = "unpack it, and give what is in it"
_MESH = "a character's URDF names its meshes"
_FROM_URDF = "a URDF of a robot can be a character"
_BAG = "'info', 'report', 'render', 'view' and 'export' take it"
_KINDS: dict[str, tuple[str, str]] = {  # what a file is, and what to do with it, by suffix
    ".fbx": ("an FBX scene", _SCENE),
    ".blend": ("a Blender scene", _SCENE),
    ".glb": ("a glTF scene", _SCENE),
    ".gltf": ("a glTF scene", _SCENE),
    ".vrma": ("a glTF animation", _SCENE),
    **dict.fromkeys(
        (".usd", ".usda", ".usdc", ".usdz"),
        ("a USD scene", f"{_SCENE}; a robot in it comes from a URDF as a rule"),
    ),
    ".vmd": ("a motion of MikuMikuDance", _SCENE),
    ".bvh": ("a motion capture (BVH)", _IMPORT),
    ".c3d": ("a motion capture (C3D)", _AS_BVH),
    ".trc": ("a motion capture (TRC)", _AS_BVH),
    ".mot": ("a motion of OpenSim", _AS_BVH),
    ".amc": ("a motion capture (Acclaim's AMC)", _AS_BVH),
    ".asf": ("a skeleton (Acclaim's ASF)", f"with its motion {_AS_BVH}"),
    ".npz": ("an archive of NumPy arrays", f"motion in it, of AMASS or SMPL: {_AS_BVH}"),
    ".npy": ("a NumPy array", _NONE_HERE),
    ".pkl": ("a Python pickle", _NONE_HERE),
    ".pt": ("a PyTorch file", _NONE_HERE),
    ".onnx": ("a network (ONNX)", "'run --onnx FILE' plays a policy"),
    ".urdf": ("the description of a robot (URDF)", _CHARACTER),
    ".xacro": ("a xacro file", _CHARACTER),
    ".sdf": ("a model or world of Gazebo (SDF)", _FROM_URDF),
    ".world": ("a world of Gazebo (SDF)", _FROM_URDF),
    ".mjcf": ("a model of MuJoCo (MJCF)", _CHARACTER),
    ".srdf": ("what MoveIt adds to a URDF (SRDF)", _FROM_URDF),
    ".proto": ("a model of Webots (PROTO)", _FROM_URDF),
    **dict.fromkeys((".step", ".stp", ".sldasm"), ("a model", _FROM_URDF)),
    **dict.fromkeys((".stl", ".obj", ".ply"), ("a mesh", _MESH)),
    ".dae": ("a mesh or scene (COLLADA)", f"{_MESH}; {_SCENE}"),
    ".csv": ("a table (CSV)", _NONE_HERE),
    ".json": ("a JSON file", "a clip in it is played by 'run --clip'"),
    ".mp4": ("a film", _NONE_HERE),
    ".png": ("a picture", _NONE_HERE),
    ".gz": ("a compressed file", _UNPACK),
    **dict.fromkeys((".zip", ".tar", ".tgz", ".7z"), ("an archive", _UNPACK)),
    ".bag": ("a bag of ROS 1", "'rosbags-convert --src FILE --dst DIR' makes one of ROS 2"),
    **dict.fromkeys((".mcap", ".db3"), ("a recording", _BAG)),
    ".py": ("a Python program", "launch files are started by 'ros2 launch'"),
    **dict.fromkeys(
        (".yaml", ".yml"),
        (
            "a YAML file",
            "of a bag give the directory, of parameters --ros-args --params-file, of a character "
            "--character",
        ),
    ),
}
_PART = "mujocoinclude"
_KINDS[_PART] = ("a part of a model of MuJoCo (MJCF)", "give the file that includes it")
_ROOTS = {"robot": ".urdf", "mujoco": ".mjcf", _PART: _PART, "COLLADA": ".dae"}
_ROOTS |= dict.fromkeys(("sdf", "gazebo", "world", "model"), ".sdf")


def refuse_other_kind(
    path: Path, wanted: str, suffixes: Collection[str], error: type[ActuatedCharactersError]
) -> None:
    """Refuse a file of a known kind that is not the one that is wanted, by beginning or name.

    A file that does not exist, or whose kind is not known, is left to its reader. A Git LFS
    pointer is refused whatever its name is.

    Args:
        path: The file.
        wanted: What belongs there, with its article, such as "a bag".
        suffixes: The suffixes that it may have, lower case.
        error: The class of the error.

    Raises:
        error: says what the file is, and what to do with it.
    """
    kind = _kind(path, suffixes)
    if kind is not None:
        what, advice = kind
        raise error(f"{path} is {what}, not {wanted}; {advice}")


def root_tag(text: str) -> str:
    """The name of the element that an XML text begins with; empty without one."""
    found = _ROOT.search(_COMMENT.sub(b"", text.encode()))
    return found[1].decode("latin-1") if found else ""


def describe_root(tag: str) -> tuple[str, str]:
    """What an XML file with this root is, and what to do with it."""
    if tag in _ROOTS:
        return _KINDS[_ROOTS[tag]]
    named = f" whose root is <{tag[:100]}>" if tag else ""
    return f"an XML file{named}", "of robots, URDF is read, as --character"


def _kind(path: Path, suffixes: Collection[str]) -> tuple[str, str] | None:
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            begin = file.read(_READ_BYTES)
    except (OSError, ValueError):  # ValueError: a NUL in the path
        return None
    suffix = path.suffix.lower()
    if begin.startswith(LFS_POINTER):
        return "a Git LFS pointer", LFS_REMEDY
    signature = next((mark for mark in _SIGNATURES if begin.startswith(mark)), b"")
    if signature and (signature == _ROS_1 or suffix in suffixes or suffix not in _KINDS):
        return _KINDS[_SIGNATURES[signature]]
    if suffix in suffixes:
        return None
    if suffix == ".xml":
        return describe_root(root_tag(begin.decode("latin-1")))
    return _KINDS.get(suffix)
