"""Files of motion that are neither a clip nor BVH: what they are, and what to do with them."""

from pathlib import Path

_BY_BLENDER = "convert it to BVH, with Blender say (import it, then File > Export > Motion Capture)"
_IMPORT = "'actuated_characters motion import'"
_FOREIGN_FORMATS = {
    ".fbx": ("an FBX scene", _BY_BLENDER),
    ".dae": ("a COLLADA scene", _BY_BLENDER),
    ".glb": ("a glTF scene", _BY_BLENDER),
    ".gltf": ("a glTF scene", _BY_BLENDER),
    ".blend": ("a file of Blender", "export it there as BVH (File > Export > Motion Capture)"),
    ".usd": ("a USD scene", _BY_BLENDER),
    ".usdz": ("a USD scene", _BY_BLENDER),
    ".vrma": ("a glTF animation", _BY_BLENDER),
    ".npz": (
        "arrays of NumPy, as AMASS and SMPL have them",
        "convert it to BVH, with SMPL's tools",
    ),
    ".npy": ("an array of NumPy", "convert it to BVH"),
    ".pkl": ("a pickle of Python, which is not opened", "convert it to BVH"),
    ".c3d": ("places of markers (C3D)", "fit a skeleton to them, and export that as BVH"),
    ".trc": ("places of markers (TRC)", "fit a skeleton to them, and export that as BVH"),
    ".mot": ("a motion of OpenSim", "convert it to BVH"),
    ".asf": ("a skeleton of Acclaim (ASF/AMC)", "convert both files to BVH, with amc2bvh say"),
    ".amc": ("a motion of Acclaim (ASF/AMC)", "convert both files to BVH, with amc2bvh say"),
    ".vmd": ("a motion of MikuMikuDance", _BY_BLENDER),
    ".mcap": ("a recorded bag", "'actuated_characters motion export' takes it"),
    ".db3": ("a recorded bag", "'actuated_characters motion export' takes it"),
}
_SIGNATURES = {  # how files begin whose names say something else
    b"Kaydara FBX Binary": ".fbx",
    b"; FBX": ".fbx",
    b"glTF": ".glb",
    b"PK\x03\x04": ".npz",
    b"\x93NUMPY": ".npy",
    b"BLENDER": ".blend",
}
_LFS_POINTER = b"version https://git-lfs"


def describe_foreign_motion(path: Path) -> str:
    """What a file of motion is that is no BVH, and what to do; empty if that is not known.

    It is told by the file's beginning, or else by its name.
    """
    beginning = b""
    try:
        with path.open("rb") as file:
            beginning = file.read(64)
    except (OSError, ValueError):
        pass  # reading it says why
    if beginning.startswith(_LFS_POINTER):
        return "a Git LFS pointer, not the file itself; 'git lfs pull' in its repository gets it"
    suffix = next(
        (kind for mark, kind in _SIGNATURES.items() if beginning.startswith(mark)),
        path.suffix.lower(),
    )
    if suffix not in _FOREIGN_FORMATS:
        return ""
    what, remedy = _FOREIGN_FORMATS[suffix]
    return f"{what}; {remedy}"


def describe_no_clip(path: Path) -> str:
    """What a file is that is given for a clip, and what to do; empty if that is not known."""
    if path.suffix.lower() == ".bvh":
        return f"a BVH file; {_IMPORT} makes a clip of it"
    described = describe_foreign_motion(path)
    if "BVH" in described:
        described += f", and {_IMPORT} makes a clip of that"
    return described
