"""A glTF 2.0 document as it is put together, and as bytes.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import base64
import json
import struct
from itertools import chain, count
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Quadruple
from msgs_config.geometry.surface import Surface

_GLB_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_FLOAT32, _UINT32 = 5126, 5125
_VERTICES, _INDICES = 34962, 34963  # targets of buffer views
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_ROUGHNESS = 0.8

Path = Literal["translation", "rotation", "scale"]


class GltfDocument:
    """Nodes, meshes, materials and one animation; all of its numbers lie in one buffer."""

    def __init__(self, generator: str) -> None:
        """`generator` is the name of the program that the file says it comes from."""
        self._head = {"asset": {"version": "2.0", "generator": generator}, "scene": 0}
        self._parts: dict[str, list[dict[str, Any]]] = {
            name: [] for name in ("nodes", "meshes", "materials", "accessors", "bufferViews")
        }
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._materials: dict[Quadruple, int] = {}
        self._names: set[str] = set()  # names of all nodes so far
        self._roots: list[int] = []
        self._binary = bytearray()

    def add_node(
        self,
        name: str,
        parent: int | None = None,
        mesh: int | None = None,
        translation: FloatArray | None = None,
        rotation_xyzw: FloatArray | None = None,
        scale: FloatArray | None = None,
    ) -> int:
        """Add a node, and return its number; without a parent it is one of the scene's.

        Args:
            name: Shown by other programs; it gets a number if another node has it.
            parent: The number of a node.
            mesh: The number of a mesh.
            translation: (3,), m in the parent; by default nothing, as for the others.
            rotation_xyzw: (4,).
            scale: (3,).
        """
        node: dict[str, Any] = {"name": self._unused(name)}
        if mesh is not None:
            node["mesh"] = mesh
        given = {"translation": translation, "rotation": rotation_xyzw, "scale": scale}
        node |= {key: value.tolist() for key, value in given.items() if value is not None}
        number = self._add("nodes", node)
        if parent is None:
            self._roots.append(number)
        else:
            self._parts["nodes"][parent].setdefault("children", []).append(number)
        return number

    def add_mesh(self, name: str, surfaces: list[tuple[Surface, Quadruple]]) -> int:
        """Add a mesh of one surface or more with their colours rgba, and return its number."""
        primitives = [
            {
                "attributes": {
                    "POSITION": self._add_accessor(surface.vertices, _VERTICES, bounds=True),
                    "NORMAL": self._add_accessor(surface.normals, _VERTICES),
                },
                "indices": self._add_accessor(surface.triangles.reshape(-1, 1), _INDICES),
                "material": self._material(color),
            }
            for surface, color in surfaces
        ]
        return self._add("meshes", {"name": name, "primitives": primitives})

    def add_times(self, times: FloatArray) -> int:
        """Add times (f,) in s, rising, for `animate`, and return their number."""
        return self._add_accessor(times[:, np.newaxis], bounds=True)

    def animate(
        self, node: int, path: Path, times: int, values: FloatArray, *, steps: bool = False
    ) -> None:
        """Let a node move.

        Args:
            node: Its number.
            path: What of it changes.
            times: The number of f times.
            values: (f, 3) in m or as factors, or quaternions xyzw (f, 4).
            steps: Whether a value holds until the next one, instead of going over to it.
        """
        interpolation = "STEP" if steps else "LINEAR"
        output = self._add_accessor(values)
        self._samplers.append({"input": times, "output": output, "interpolation": interpolation})
        target = {"node": node, "path": path}
        self._channels.append({"sampler": len(self._samplers) - 1, "target": target})

    def to_gltf(self) -> bytes:
        """The document as text, with its numbers in it as base64."""
        uri = "data:application/octet-stream;base64," + base64.b64encode(self._binary).decode()
        return self._json({"uri": uri})

    def to_glb(self) -> bytes:
        """The document in its binary form."""
        text = self._json({})
        text += b" " * (-len(text) % 4)
        chunks = [(_JSON_CHUNK, text)]
        if self._binary:
            chunks.append((_BINARY_CHUNK, bytes(self._binary)))
        body = b"".join(struct.pack("<II", len(part), kind) + part for kind, part in chunks)
        return struct.pack("<III", _GLB_MAGIC, 2, 12 + len(body)) + body

    def _json(self, buffer: dict[str, str]) -> bytes:
        content: dict[str, Any] = {**self._head, "scenes": [{"nodes": self._roots}]}
        content |= {name: entries for name, entries in self._parts.items() if entries}
        if self._channels:
            animation = {"name": "motion", "channels": self._channels, "samplers": self._samplers}
            content["animations"] = [animation]
        if self._binary:
            content["buffers"] = [{**buffer, "byteLength": len(self._binary)}]
        return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()

    def _add(self, part: str, entry: dict[str, Any]) -> int:
        self._parts[part].append(entry)
        return len(self._parts[part]) - 1

    def _unused(self, name: str) -> str:
        """A name that no node has: browsers tell by it which node is to move."""
        numbered = (f"{name}_{number}" for number in count(2))
        unused = next(each for each in chain((name,), numbered) if each not in self._names)
        self._names.add(unused)
        return unused

    def _add_accessor(
        self, rows: NDArray[Any], target: int | None = None, *, bounds: bool = False
    ) -> int:
        """Add rows (m, width) of numbers, 32 bits each, so that all stays aligned."""
        is_float = rows.dtype.kind == "f"
        stored = np.ascontiguousarray(rows, dtype="<f4" if is_float else "<u4")
        view: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": len(self._binary),
            "byteLength": stored.nbytes,
        }
        if target is not None:
            view["target"] = target
        self._binary += stored.tobytes()
        accessor: dict[str, Any] = {
            "bufferView": self._add("bufferViews", view),
            "componentType": _FLOAT32 if is_float else _UINT32,
            "count": len(stored),
            "type": _TYPES[stored.shape[1]],
        }
        if bounds:
            accessor |= {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
        return self._add("accessors", accessor)

    def _material(self, color_rgba: Quadruple) -> int:
        if color_rgba not in self._materials:
            factor = [*map(_linear, color_rgba[:3]), color_rgba[3]]
            surface = {
                "baseColorFactor": factor,
                "metallicFactor": 0.0,
                "roughnessFactor": _ROUGHNESS,
            }
            material: dict[str, Any] = {"pbrMetallicRoughness": surface}
            if color_rgba[3] < 1.0:
                material["alphaMode"] = "BLEND"
            self._materials[color_rgba] = self._add("materials", material)
        return self._materials[color_rgba]


def _linear(level: float) -> float:
    """A part of a colour, 0 to 1, without the gamma of sRGB (IEC 61966-2-1): as glTF has it."""
    level = min(max(level, 0.0), 1.0)
    return level / 12.92 if level <= 0.04045 else float(((level + 0.055) / 1.055) ** 2.4)
