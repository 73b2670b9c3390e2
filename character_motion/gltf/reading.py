"""Reads a binary glTF 2.0 file (.glb): its description, and the numbers in its buffer.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html

A file is not trusted: what it says of its own sizes is compared with what is there.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from character_motion.gltf.kinds import COMPONENTS, WIDTHS
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import SkinError
from msgs_config.file_kinds import refuse_other_kind

_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
_MOST_BYTES = 256 * 1024 * 1024
_MOST_NODES = 16_384
_MOST_ROWS = 2_000_000  # of an accessor
_PARTS = ("nodes", "meshes", "skins", "accessors", "bufferViews", "buffers")
_PARTS_OF_LOOKS = ("materials", "textures", "images")
_KNOWN_EXTENSIONS = (
    "KHR_materials_",
    "KHR_lights_",
    "KHR_mesh_quantization",
    "KHR_texture_",
    "VRM",
)
_FLAWS = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError)
"""What wrong content comes to where it is read as if it were right."""


@dataclass(frozen=True)
class GlbFile:
    """The description in a file, as its JSON has it, and its buffer."""

    path: Path
    content: dict[str, Any]
    binary: bytes

    @classmethod
    def read(cls, path: Path) -> "GlbFile":
        """Read a file.

        Raises:
            SkinError: it cannot be read, is no .glb file, is damaged, larger than 256 MB, or needs
                what is not read here.
        """
        try:
            size = path.stat().st_size
            if size > _MOST_BYTES:
                raise SkinError(f"{path} has {size / 1e6:.0f} MB; it must be 256 MiB or less")
            raw = path.read_bytes()
        except (OSError, ValueError) as error:  # ValueError: a NUL in the path
            reason = getattr(error, "strerror", None) or error
            raise SkinError(f"cannot read {path}: {reason}") from error
        content, binary = _chunks(path, raw)
        file = cls(path, content, binary)
        file._check()
        return file

    def _check(self) -> None:
        if not isinstance(self.content, dict):
            raise self.damaged("its description is no JSON object")
        for part in (*_PARTS, *_PARTS_OF_LOOKS):
            found = self.content.get(part, [])
            if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
                raise self.damaged(f"{part} is no list of objects")
        with Holding(self):
            for name in self.content.get("extensionsRequired", ()):
                if not str(name).startswith(_KNOWN_EXTENSIONS):
                    raise SkinError(
                        f"{self.path} needs {str(name)[:60]}, which is not read here; export it "
                        "without compression"
                    )
            count = len(self.content.get("nodes", ()))
            if count > _MOST_NODES:
                raise SkinError(f"{self.path} has {count} nodes; it must be {_MOST_NODES} or fewer")

    def damaged(self, what: str) -> SkinError:
        """The error of a file whose content does not hold together."""
        return SkinError(f"{self.path} is damaged: {what}")

    def entries(self, part: str) -> list[dict[str, Any]]:
        """The entries of a part of the description, such as `nodes`."""
        found: list[dict[str, Any]] = self.content.get(part, [])
        return found

    def entry(self, part: str, number: object) -> dict[str, Any]:
        """The entry of a number; raises LookupError or ValueError if there is none."""
        return self.entries(part)[_index(number)]

    def view(self, number: int) -> bytes:
        """The bytes of a view of the buffer."""
        view = self.entry("bufferViews", number)
        if _index(view.get("buffer", 0)) or "uri" in self.entries("buffers")[0]:
            raise SkinError(f"{self.path} has its numbers in other files; export it as one .glb")
        start, length = _index(view.get("byteOffset", 0)), _index(view["byteLength"])
        if start + length > len(self.binary):
            raise self.damaged(f"view {number} goes beyond the end of its numbers")
        return self.binary[start : start + length]

    def _rows(
        self, holder: Mapping[str, Any], name: str, kinds: Sequence[str]
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """The rows (m, width) of an accessor, as numbers of the kind that they are stored in."""
        number = holder[name]
        accessor = self.entry("accessors", number)
        if accessor["type"] not in kinds:
            raise self.damaged(
                f"{name} is {accessor['type']!s:.20}; it must be {' or '.join(kinds)}"
            )
        return self._content(number, accessor), accessor

    def _content(self, number: int, accessor: dict[str, Any]) -> NDArray[Any]:
        """The rows (m, width) of an accessor of a number."""
        count, width = _index(accessor["count"]), WIDTHS[accessor["type"]]
        kind = np.dtype(COMPONENTS[accessor["componentType"]])
        if count > _MOST_ROWS:
            raise SkinError(
                f"{self.path}: accessor {number} has {count} rows; at most {_MOST_ROWS}"
            )
        if "sparse" in accessor:
            raise SkinError(f"{self.path} has sparse accessors, which are not read here")
        if "bufferView" not in accessor:
            return np.zeros((count, width), dtype=kind)
        content = self.view(accessor["bufferView"])
        view = self.entry("bufferViews", accessor["bufferView"])
        stride = _index(view.get("byteStride", 0)) or width * kind.itemsize
        start = _index(accessor.get("byteOffset", 0))
        if count and start + (count - 1) * stride + width * kind.itemsize > len(content):
            raise self.damaged(f"accessor {number} goes beyond the end of its numbers")
        rows: NDArray[Any] = np.ndarray(
            (count, width), kind, content, start, (stride, kind.itemsize)
        )
        return rows

    def numbers(self, holder: Mapping[str, Any], name: str, *kinds: str) -> FloatArray:
        """The rows (m, width) of an accessor as floats; integers that are shares, as such.

        Args:
            holder: What has its number, such as the attributes of a mesh.
            name: By which name it has it.
            kinds: The types, such as VEC3, of which one must be the accessor's.

        Raises:
            SkinError: they are not there, of another type, or not finite.
        """
        rows, accessor = self._rows(holder, name, kinds)
        values = rows.astype(np.float64)
        if accessor.get("normalized") and rows.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(rows.dtype).max, -1.0)
        if not np.isfinite(values).all():
            raise self.damaged(f"{name} has numbers that are not finite")
        return values

    def indices(self, holder: Mapping[str, Any], name: str, kind: str, below: int) -> IntArray:
        """The rows (m, width) of an accessor as numbers of things of which there are so many."""
        rows, _ = self._rows(holder, name, (kind,))
        if rows.dtype.kind != "u" or rows.max(initial=0) >= max(below, 1):
            raise self.damaged(f"{name} refers to what is not there")
        return rows.astype(np.intp)


class Holding:
    """Within it, what a file's content lacks becomes the error of a damaged file."""

    def __init__(self, file: GlbFile) -> None:
        self._file = file

    def __enter__(self) -> None:
        return

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, _FLAWS):
            what = str(error).replace("\n", " ")[:80]
            raise self._file.damaged(f"{type(error).__name__}: {what}") from error


def _chunks(path: Path, raw: bytes) -> tuple[Any, bytes]:
    """The description and the buffer of a file's bytes."""
    if not raw.startswith(_MAGIC) and path.suffix.lower() == ".gltf":
        raise SkinError(f"{path} is glTF as text; export it as one binary file (.glb)")
    if not raw.startswith(_MAGIC):
        refuse_other_kind(path, "a skinned character (.glb)", (".glb",), SkinError)
    if not raw.startswith(_MAGIC) or len(raw) < 20:
        raise SkinError(f"{path} is no binary glTF file (.glb)")
    _, version, length = struct.unpack_from("<4sII", raw)
    if version != 2:
        raise SkinError(f"{path} is glTF {version}; it must be 2.0")
    if length != len(raw):
        raise SkinError(f"{path} is damaged: it has {len(raw)} bytes, and says {length}")
    parts: dict[bytes, bytes] = {}
    start = 12
    while start + 8 <= len(raw):
        size, kind = struct.unpack_from("<I4s", raw, start)
        parts.setdefault(kind, raw[start + 8 : start + 8 + size])
        start += 8 + size
    if start != len(raw) or _JSON_CHUNK not in parts:
        raise SkinError(f"{path} is damaged: its chunks do not fit its length")
    try:
        content = json.loads(parts[_JSON_CHUNK])
    except (ValueError, RecursionError) as error:
        raise SkinError(f"{path} is damaged: its description is no JSON") from error
    return content, parts.get(_BINARY_CHUNK, b"")


def _index(value: object) -> int:
    """A number of something; raises ValueError if it is none."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(f"{value!r:.40} is no number of an entry")
    return value
