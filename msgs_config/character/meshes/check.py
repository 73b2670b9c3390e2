"""Meshes checked before the engine reads them: it trusts every number in them."""

import re
from hashlib import sha256
from math import isfinite
from pathlib import Path

from msgs_config.errors import CharacterError

MAX_LINE = 4000  # characters; the engine cuts longer ones

_OBJ_LISTS = ("v", "vt", "vn")  # in the order in which a corner of a face names them
_OBJ_CORNER = re.compile(r"-?\d+(/-?\d+|//-?\d+|/-?\d+/-?\d+)?", re.ASCII)

_sound = set[bytes]()  # digests of .obj files that were checked


def check_mesh(path: Path) -> None:
    """Check that a mesh is one that the engine reads, and that its faces have their vertices.

    Raises:
        CharacterError: it is not so; names the file.
    """
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".stl"):
        raise CharacterError(
            f"mesh {path} is to collide with; it must be an .obj, .stl, .dae, .glb or .ply file"
        )
    try:
        if suffix == ".obj":
            _check_obj_once(path.read_bytes())
        else:
            _check_stl(path)
    except (OSError, ValueError) as error:
        raise CharacterError(f"mesh {path} cannot be used: {str(error)[:200]}") from error


def is_stl_of_text(path: Path) -> bool:
    """Whether a mesh is an .stl file that has a text, and not the binary form."""
    if path.suffix.lower() != ".stl":
        return False
    try:
        with path.open("rb") as file:
            start = file.read(512)
        return start.lstrip()[:5].lower() == b"solid" and b"\0" not in start
    except OSError:
        return False  # `check_mesh` gives the reason


def _check_stl(path: Path) -> None:
    """The header of 80 bytes, the number of triangles, and 50 bytes for each."""
    with path.open("rb") as file:
        count = int.from_bytes(file.read(84)[80:], "little")
    if count == 0 or path.stat().st_size != 84 + 50 * count:
        raise ValueError("it is no whole STL file")


def _check_obj_once(raw: bytes) -> None:
    """Check a text that has not been found to be sound: a process loads each mesh several times."""
    digest = sha256(raw).digest()
    if digest not in _sound:
        _check_obj(raw.decode("latin-1"))
        _sound.add(digest)


def _check_obj(text: str) -> None:
    counts = dict.fromkeys(_OBJ_LISTS, 0)
    # Split as the engine does: Python's own splitting knows more separators and ends of lines.
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) > MAX_LINE:
            raise ValueError(f"line {number} is longer than {MAX_LINE}")
        kind, *pieces = re.split("[ \t]+", line.strip(" \t\r"))
        if kind in counts:
            counts[kind] += 1
            if not all(isfinite(float(piece)) for piece in pieces):
                raise ValueError(f"line {number} has a number that is not finite")
        elif kind == "f":
            _check_face(number, pieces, counts)


def _check_face(number: int, corners: list[str], counts: dict[str, int]) -> None:
    for corner in corners:
        if not _OBJ_CORNER.fullmatch(corner):
            raise ValueError(f"line {number} is no face")
        for name, index in zip(_OBJ_LISTS, corner.split("/"), strict=False):
            # An index counts from 1, or back from the last one so far.
            if index and not 1 <= abs(int(index)) <= counts[name]:
                raise ValueError(f"line {number} names a {name} that is not there: {index}")
