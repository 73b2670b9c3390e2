"""Triangles of mesh files, and a file of them for what reads fewer formats than URDFs name.

Bullet reads .obj and binary .stl well. It reads no .stl of text, and follows missing parts of a
COLLADA file into a crash. These two, .glb and .ply are read here and handed on as binary .stl, of
which Bullet makes one convex hull, as of any .stl.
"""

import io
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.check import check_mesh, is_stl_of_text
from msgs_config.character.meshes.wavefront import read_wavefront
from msgs_config.errors import CharacterError
from msgs_config.geometry import fixed_order
from msgs_config.runtime.extras import require_extra

_MAX_TRIANGLES = 2_000_000
_MAX_NODES = 20_000  # of a COLLADA file, whose nodes may repeat each other
_STL_HEADER_BYTES = 80
_STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
_VERTEX_OF_TEXT = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def file_for_engine(path: Path, directory: Path, name: str) -> Path:
    """The mesh's own file, checked, or a binary .stl of this name that is made of it.

    Args:
        path: A mesh of any format that can be used.
        directory: Where the .stl goes.
        name: The .stl's name, without suffix.

    Raises:
        CharacterError: the mesh cannot be used; names its file.
    """
    check_for_engine(path)
    if not is_converted(path):
        return path
    file = directory / f"{name}.stl"
    file.write_bytes(_stl_of(path))
    return file


def check_readable(path: Path) -> None:
    """Raise CharacterError unless a mesh can be used; names its file."""
    if path.suffix.lower() == ".obj":
        read_wavefront(path)
    else:
        check_for_engine(path)


def check_for_engine(path: Path) -> None:
    """Raise CharacterError unless an engine reads a mesh, or what is made of it; names its file."""
    if is_converted(path):
        _stl_of(path)
    else:
        check_mesh(path)


def read_vertices(path: Path) -> FloatArray:
    """The vertices (m, 3) of a mesh, in the units of its URDF's scale, some of them repeated.

    Raises:
        CharacterError: the mesh cannot be used; names its file.
    """
    if path.suffix.lower() == ".obj":
        return read_wavefront(path).vertices.copy()
    check_readable(path)
    stl = _stl_of(path) if is_converted(path) else path.read_bytes()
    corners = np.frombuffer(stl, _STL_TRIANGLE, offset=_STL_HEADER_BYTES + 4)["corners"]
    return corners.reshape(-1, 3).astype(float)


def is_converted(path: Path) -> bool:
    """Whether a mesh has a format that the engines do not read, or not well."""
    return path.suffix.lower() in _READERS or is_stl_of_text(path)


def _stl_of(path: Path) -> bytes:
    try:
        status = path.stat()
        return _stl_of_version(path, status.st_mtime_ns, status.st_size)
    except CharacterError:
        raise
    except Exception as error:  # whatever a reader of others makes of a broken file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise CharacterError(f"mesh {path} cannot be used: {reason}") from error


@lru_cache(maxsize=64)  # a process loads each mesh several times
def _stl_of_version(path: Path, modified_ns: int, size: int) -> bytes:
    del modified_ns, size
    raw = path.read_bytes()
    triangles = _READERS.get(path.suffix.lower(), _read_text)(path, raw)
    # single precision, as the format has it, also makes up for last bits of the file's transforms
    corners = triangles.astype(np.float32)
    if not len(corners) or not np.isfinite(corners).all():
        raise CharacterError(
            f"mesh {path} cannot be used: it has "
            + ("a vertex that is not finite" if len(corners) else "no triangles")
        )
    stl = np.zeros(len(corners), _STL_TRIANGLE)
    stl["corners"], stl["normal"] = corners, _normals(corners.astype(float))
    return bytes(_STL_HEADER_BYTES) + len(stl).to_bytes(4, "little") + stl.tobytes()


def _normals(corners: FloatArray) -> FloatArray:
    """Unit normals (m, 3) of triangles (m, 3, 3); zero for one without area."""
    normals = fixed_order.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = fixed_order.norm(normals)[:, np.newaxis]
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)


def _read_text(path: Path, raw: bytes) -> FloatArray:
    """The triangles (m, 3, 3) of an .stl of text."""
    del path
    numbers = [match.groups() for match in _VERTEX_OF_TEXT.finditer(raw)]
    if len(numbers) % 3:
        raise ValueError("its text ends within a triangle")
    return np.array(numbers, dtype=float).reshape(-1, 3, 3)


def _read_collada(path: Path, raw: bytes) -> FloatArray:
    """The triangles (m, 3, 3) of all geometries of a COLLADA file's scene, m.

    As RViz has it: transforms of nodes and the unit count, the axis that is up does not.
    """
    try:
        import collada
    except ImportError as error:
        raise CharacterError(
            f"mesh {path} is COLLADA, which takes pycollada to read: pip install pycollada"
        ) from error
    if b"<!DOCTYPE" in raw or b"<!ENTITY" in raw or b"<COLLADA" not in raw:
        raise ValueError("it is no COLLADA, or declares a document type, which is not allowed")
    content = collada.Collada(io.BytesIO(raw), ignore=[collada.common.DaeError])
    nodes = content.scene.nodes if content.scene is not None else []
    parts: list[FloatArray] = [np.empty((0, 3, 3))]
    count = 0
    for number, (primitives, matrix) in enumerate(_walk(nodes, np.eye(4))):
        if number == _MAX_NODES:
            raise ValueError(f"it has more than {_MAX_NODES} nodes")
        for triangles in _triangles(primitives):
            count += len(triangles)
            if count > _MAX_TRIANGLES:
                raise ValueError(f"it has more than {_MAX_TRIANGLES} triangles")
            parts.append(fixed_order.apply(matrix[:3, :3], triangles) + matrix[:3, 3])
    unit = content.assetInfo.unitmeter
    return np.concatenate(parts) * (1.0 if unit is None else float(unit))


def _read_by_trimesh(path: Path, raw: bytes) -> FloatArray:
    """The triangles (m, 3, 3) of a .glb or .ply file, in its own axes and units."""
    require_extra("meshes", f"mesh {path}", CharacterError)
    import trimesh

    scene = trimesh.load_scene(io.BytesIO(raw), file_type=path.suffix[1:].lower())
    if sum(len(each.faces) for each in scene.geometry.values()) > _MAX_TRIANGLES:
        raise ValueError(f"it has more than {_MAX_TRIANGLES} triangles")
    return np.asarray(scene.to_mesh().triangles, dtype=float)


def _walk(nodes: list[Any], above: FloatArray) -> Iterator[tuple[list[Any], FloatArray]]:
    """The nodes of a scene: the primitives of each, and its pose (4, 4) in the scene."""
    from collada.scene import GeometryNode, Node, NodeNode

    for node in nodes:
        if isinstance(node, GeometryNode):
            yield node.geometry.primitives, above
        elif isinstance(node, Node):
            matrix = above
            for transform in (node.node if isinstance(node, NodeNode) else node).transforms:
                matrix = fixed_order.product(matrix, np.asarray(transform.matrix, dtype=float))
            yield [], matrix
            yield from _walk(node.children, matrix)


def _triangles(primitives: list[Any]) -> Iterator[FloatArray]:
    """The triangles (m, 3, 3) of what has a surface, as the geometry has them."""
    from collada.polylist import Polylist
    from collada.triangleset import TriangleSet

    for primitive in primitives:
        part = primitive.triangleset() if isinstance(primitive, Polylist) else primitive
        if isinstance(part, TriangleSet) and part.vertex is not None and len(part):
            yield np.asarray(part.vertex, dtype=float)[part.vertex_index]


_READERS = {".dae": _read_collada, ".glb": _read_by_trimesh, ".ply": _read_by_trimesh}
"""By the suffixes of meshes that are converted, beside .stl of text."""
