"""Wavefront .obj files: corners with their normals, and the picture that is laid on them."""

from functools import lru_cache
from itertools import chain, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import CharacterError

_WIDTHS = {"v": 3, "vt": 2, "vn": 3}  # in the order in which a corner of a face names them
_MISSING_INDICES = ("/0/0", "/0", "")  # what a corner with so many slashes lacks
_Rows = dict[str, list[list[str]]]


class WavefrontMesh(NamedTuple):
    """The triangles of a file; larger polygons are divided into fans."""

    vertices: FloatArray  # (m, 3), in the file's units
    uvs: FloatArray  # (t, 2): places in a picture, right and up, 1 at its edges
    normals: FloatArray  # (n, 3), of any length
    corners: IntArray  # (k, 3, 3): of each corner the rows of vertex, uv and normal, -1: none
    picture: Path | None  # the first that a material in use names, and that is there


def read_wavefront(path: Path) -> WavefrontMesh:
    """The content of an .obj file, which must not be changed.

    Raises:
        CharacterError: the file cannot be used; names it.
    """
    try:
        status = path.stat()
        return _read_version(path, status.st_mtime_ns, status.st_size)
    except (OSError, OverflowError, ValueError) as error:
        raise CharacterError(f"mesh {path} cannot be used: {str(error)[:200]}") from error


@lru_cache(maxsize=16)  # a process reads each mesh several times
def _read_version(path: Path, modified_ns: int, size: int) -> WavefrontMesh:
    del modified_ns, size
    rows: _Rows = {kind: [] for kind in _WIDTHS}
    named: list[str] = []
    libraries, materials = list[Path](), dict[str, None]()
    for number, line in enumerate(path.read_text(encoding="latin-1").split("\n"), start=1):
        kind, *pieces = line.split() or ("",)
        if kind in rows:
            rows[kind].append(pieces)
        elif kind == "f":
            try:
                named += _fan(pieces, rows)
            except ValueError as error:
                raise ValueError(f"line {number} is no face") from error
        elif kind == "mtllib":
            libraries.append(path.parent / _name(line))
        elif kind == "usemtl":
            materials[_name(line)] = None
    vertices, uvs, normals = (_numbers(rows[kind], width) for kind, width in _WIDTHS.items())
    corners = _indices(named, [len(vertices), len(uvs), len(normals)])
    picture = _find_picture(libraries, list(materials))
    return WavefrontMesh(vertices, uvs, normals, corners, picture)


def _name(line: str) -> str:
    """What follows a keyword; it may have spaces in it."""
    return "".join(line.split(maxsplit=1)[1:]).strip()


def _numbers(rows: list[list[str]], width: int) -> FloatArray:
    """So many numbers of each row (m, width); what is not given is 0."""
    if any(len(row) < width for row in rows):
        rows = [row + ["0"] * width for row in rows]
    flat = [float(piece) for piece in chain.from_iterable(row[:width] for row in rows)]
    numbers = np.array(flat).reshape(-1, width)
    if not np.isfinite(numbers).all():
        raise ValueError("it has a number that is not finite")
    return numbers


def _fan(corners: list[str], rows: _Rows) -> list[str]:
    """The corners of the triangles that a polygon is divided into, three by three."""
    if any("-" in corner for corner in corners):  # counted back from what there is so far
        corners = [_counted_forwards(corner, rows) for corner in corners]
    if len(corners) == 3:
        return corners
    return [corner for pair in pairwise(corners[1:]) for corner in (corners[0], *pair)]


def _counted_forwards(corner: str, rows: _Rows) -> str:
    indices = zip(corner.split("/"), rows.values(), strict=False)
    return "/".join(
        str(len(own) + 1 + int(index)) if index.startswith("-") else index for index, own in indices
    )


def _indices(corners: list[str], counts: list[int]) -> IntArray:
    """The rows (k, 3, 3) that corners name, of lists with so many; -1: none."""
    whole = [corner.replace("//", "/0/") for corner in corners]
    if not whole:
        return np.empty((0, 3, 3), dtype=np.intp)
    if max(corner.count("/") for corner in whole) > 2:
        raise ValueError("a corner of a face has more than three numbers")
    text = "/".join([corner + _MISSING_INDICES[corner.count("/")] for corner in whole])
    indices = np.array([int(index) for index in text.split("/")], dtype=np.intp).reshape(-1, 3, 3)
    if (indices < (1, 0, 0)).any() or (indices > counts).any():
        raise ValueError("a face names something that is not there")
    return indices - 1


def _find_picture(libraries: list[Path], materials: list[str]) -> Path | None:
    """The first picture that a material in use names and that is there; none is no error."""
    pictures: dict[str, Path] = {}
    for library in libraries:
        try:
            lines = library.read_text(encoding="latin-1").split("\n")
        except (OSError, ValueError):  # not there, or such a name that it cannot be
            continue
        material = ""
        for line in lines:
            kind, *pieces = line.split() or ("",)
            if kind == "newmtl":
                material = _name(line)
            elif kind == "map_Kd" and pieces:  # options may come before the name
                pictures.setdefault(material, library.parent / pieces[-1])
    found = (pictures[material] for material in materials if material in pictures)
    return next((path for path in found if _is_file(path)), None)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # such as a name that is too long
        return False
