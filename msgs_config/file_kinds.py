"""Says what a file is that is given where another one belongs, and what can be done with it."""

import re
from collections.abc import Collection
from pathlib import Path

from msgs_config.errors import ActuatedCharactersError

_POINTER = b"version https://git-lfs.github.com/spec/"
_ROS_1 = b"#ROSBAG V"
_ROOT = re.compile(rb"<(?![?!])([A-Za-z][\w.:-]*)")
_COMMENT = re.compile(rb"<!--.*?(-->|\Z)", re.DOTALL)
_READ_BYTES = 4096  # bytes of a file's beginning

_CHARACTER = "a robot goes where a character does: --character"
_SCENE = "Blender makes a .bvh of its motion, which 'motion import' reads"
_IMPORT = "'actuated_characters motion import' makes a clip of it"
_NONE_HERE = "no command reads it"
_UNPACK = "unpack it, and give what is in it"
_MESH = "a character's URDF names its meshes"
_BAG = "'info', 'report', 'render' and 'view' take it"
_KINDS: dict[str, tuple[str, str]] = {  # what a file is, and what to do with it, by suffix
    ".fbx": ("an FBX scene", _SCENE),
    ".blend": ("a Blender scene", _SCENE),
    ".glb": ("a glTF scene", _SCENE),
    ".gltf": ("a glTF scene", _SCENE),
    ".usd": ("a USD scene", _SCENE),
    ".usda": ("a USD scene", _SCENE),
    ".bvh": ("a motion capture (BVH)", _IMPORT),
    ".c3d": ("a motion capture (C3D)", f"as a .bvh file {_IMPORT}"),
    ".amc": ("a motion capture (AMC)", f"as a .bvh file {_IMPORT}"),
    ".asf": ("a skeleton (ASF)", f"with its motion as a .bvh file {_IMPORT}"),
    ".npz": ("an archive of NumPy arrays", f"motion in it: as a .bvh file {_IMPORT}"),
    ".npy": ("a NumPy array", _NONE_HERE),
    ".pkl": ("a Python pickle", _NONE_HERE),
    ".pt": ("a PyTorch file", _NONE_HERE),
    ".onnx": ("a network (ONNX)", _NONE_HERE),
    ".urdf": ("the description of a robot (URDF)", _CHARACTER),
    ".xacro": ("a xacro file", _CHARACTER),
    ".sdf": ("a model or world of Gazebo (SDF)", "a URDF of it can be a character"),
    ".world": ("a world of Gazebo (SDF)", "a URDF of a robot can be a character"),
    ".mjcf": ("a model of MuJoCo (MJCF)", "a URDF of it can be a character"),
    ".stl": ("a mesh", _MESH),
    ".obj": ("a mesh", _MESH),
    ".dae": ("a mesh or scene (COLLADA)", _MESH),
    ".ply": ("a mesh", _MESH),
    ".csv": ("a table (CSV)", _NONE_HERE),
    ".mp4": ("a film", _NONE_HERE),
    ".png": ("a picture", _NONE_HERE),
    ".zip": ("an archive", _UNPACK),
    ".tar": ("an archive", _UNPACK),
    ".tgz": ("an archive", _UNPACK),
    ".gz": ("a compressed file", _UNPACK),
    ".7z": ("an archive", _UNPACK),
    ".bag": ("a bag of ROS 1", "'rosbags-convert --src FILE --dst DIR' makes one of ROS 2"),
    ".mcap": ("a recording", _BAG),
    ".db3": ("a recording", _BAG),
    ".py": ("a Python program", "launch files are started by 'ros2 launch'"),
    ".yaml": (
        "a YAML file",
        "of a bag give the directory, of parameters --ros-args --params-file, of a character "
        "--character",
    ),
}
_KINDS[".yml"] = _KINDS[".yaml"]
_XML: dict[bytes, str] = {b"mujoco": ".mjcf", b"mujocoinclude": ".mjcf", b"sdf": ".sdf"}
_XML |= {b"robot": ".urdf", b"gazebo": ".sdf", b"world": ".sdf"}
_OTHER_XML = ("an XML file", "of robots, URDF is read, as --character")


def refuse_other_kind(
    path: Path, wanted: str, suffixes: Collection[str], error: type[ActuatedCharactersError]
) -> None:
    """Refuse a file of a known kind that is not the one that is wanted.

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


def _kind(path: Path, suffixes: Collection[str]) -> tuple[str, str] | None:
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            begin = file.read(_READ_BYTES)
    except (OSError, ValueError):  # ValueError: a NUL in the path
        return None
    suffix = path.suffix.lower()
    if begin.startswith(_POINTER):
        return "a Git LFS pointer", "'git lfs pull' in its repository fetches the file itself"
    if begin.startswith(_ROS_1):
        return _KINDS[".bag"]
    if suffix in suffixes:
        return None
    if suffix == ".xml":
        root = _ROOT.search(_COMMENT.sub(b"", begin))
        return _KINDS.get(_XML.get(root[1] if root else b"", ""), _OTHER_XML)
    return _KINDS.get(suffix)
