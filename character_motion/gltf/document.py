"""A glTF 2.0 document as it is put together, and as bytes.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import base64
import json
import struct
from collections.abc import Sequence
from itertools import chain, count
from typing import Any, Literal, TypeAlias

import numpy as np

from character_motion.gltf.buffer import INDICES, VERTICES, NumberBuffer
from character_motion.gltf.gamma import without_gamma
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Quadruple
from msgs_config.geometry.surface import Surface

_GLB_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_ROUGHNESS = 0.8
_LINEAR, _LINEAR_OF_SMALLER_ONES, _REPEAT = 9729, 9987, 10497  # of a texture's sampler
_MOST_IN_A_BYTE = 256

Path = Literal["translation", "rotation", "scale"]
Attributes: TypeAlias = dict[str, int]
"""The accessors of vertices by what they are: places, normals and the like."""
Part: TypeAlias = tuple[Attributes, IntArray, int]
"""A part of a mesh: vertices, triangles (k, 3) of them, and a material."""


class GltfDocument:
    """Nodes, meshes, materials, skins and one animation; its numbers lie in one buffer."""

    def __init__(self, generator: str) -> None:
        """`generator` is the name of the program that the file says it comes from."""
        self._head = {"asset": {"version": "2.0", "generator": generator}, "scene": 0}
        self._parts: dict[str, list[dict[str, Any]]] = {}
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._materials: dict[Quadruple, int] = {}
        self._names: set[str] = set()  # names of all nodes so far
        self._roots: list[int] = []
        self._buffer = NumberBuffer(self._add)

    def add_node(
        self,
        name: str,
        parent: int | None = None,
        mesh: int | None = None,
        translation: FloatArray | None = None,
        rotation_xyzw: FloatArray | None = None,
        scale: FloatArray | None = None,
        skin: int | None = None,
    ) -> int:
        """Add a node, and return its number; without a parent it is one of the scene's.

        Args:
            name: Shown by other programs; it gets a number if another node has it.
            parent: The number of a node.
            mesh: The number of a mesh.
            translation: (3,), m in the parent; by default nothing, as for the others.
            rotation_xyzw: (4,).
            scale: (3,).
            skin: The number of a skin that moves the mesh; then only the skin's nodes do.
        """
        node: dict[str, Any] = {"name": self._unused(name)}
        numbers = {"mesh": mesh, "skin": skin}
        node |= {key: number for key, number in numbers.items() if number is not None}
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
        return self.add_mesh_of(
            name,
            [
                (self.add_vertices(surface), surface.triangles, self.material(color))
                for surface, color in surfaces
            ],
        )

    def add_mesh_of(self, name: str, parts: Sequence[Part]) -> int:
        """Add a mesh of parts, whose vertices may be the same ones, and return its number."""
        primitives = []
        for attributes, triangles, material in parts:
            corners = self._buffer.add_rows(triangles.reshape(-1, 1), INDICES, component="<u4")
            primitives.append({"attributes": attributes, "indices": corners, "material": material})
        return self._add("meshes", {"name": name, "primitives": primitives})

    def add_vertices(
        self,
        surface: Surface,
        uvs: FloatArray | None = None,
        colors: FloatArray | None = None,
    ) -> Attributes:
        """Add the vertices (m) of a surface, in m, with their normals.

        Args:
            surface: Which.
            uvs: Where they are in a texture (m, 2), right and down, 1 at its edges.
            colors: Red, green and blue (m, 3), 0 to 1, with sRGB's gamma; the material's is
                multiplied by them.
        """
        add = self._buffer.add_rows
        attributes = {
            "POSITION": add(surface.vertices, VERTICES, bounds=True),
            "NORMAL": add(surface.normals, VERTICES),
        }
        if uvs is not None:
            attributes["TEXCOORD_0"] = add(uvs, VERTICES)
        if colors is not None:
            attributes["COLOR_0"] = add(without_gamma(colors), VERTICES)
        return attributes

    def bind(self, joints: IntArray, weights: FloatArray) -> Attributes:
        """Add what moves vertices (m): nodes of a skin (m, 4), and how much each (m, 4), sum one.

        To be joined with the attributes of `add_vertices`.
        """
        shares = weights.astype(np.float32)
        shares /= shares.sum(axis=1, keepdims=True)
        used = np.where(shares > 0.0, joints, 0)
        fits = used.max(initial=0) < _MOST_IN_A_BYTE
        add = self._buffer.add_rows
        return {
            "JOINTS_0": add(used, VERTICES, component="|u1" if fits else "<u2"),
            "WEIGHTS_0": add(shares, VERTICES),
        }

    def add_matrices(self, matrices: FloatArray) -> int:
        """Add matrices (l, 4, 4), such as `add_skin` takes, and return their number."""
        return self._buffer.add_rows(np.swapaxes(matrices, 1, 2).reshape(-1, 16))

    def add_skin(self, name: str, joints: Sequence[int], inverse_binds: int) -> int:
        """Add a skin, and return its number.

        Args:
            name: Shown by other programs.
            joints: Nodes (l,).
            inverse_binds: The number of l matrices: each leads from the place of a vertex, as its
                mesh has it, into the frame of a node.
        """
        skin = {"name": name, "inverseBindMatrices": inverse_binds, "joints": list(joints)}
        return self._add("skins", skin)

    def add_times(self, times: FloatArray) -> int:
        """Add times (f,) in s, rising, for `animate`, and return their number."""
        return self._buffer.add_rows(times[:, np.newaxis], bounds=True)

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
        output = self._buffer.add_rows(values)
        self._samplers.append({"input": times, "output": output, "interpolation": interpolation})
        target = {"node": node, "path": path}
        self._channels.append({"sampler": len(self._samplers) - 1, "target": target})

    def material(self, color_rgba: Quadruple) -> int:
        """The number of the material of a colour, 0 to 1, with the gamma of sRGB."""
        if color_rgba not in self._materials:
            factor = [*without_gamma(np.array(color_rgba[:3])).tolist(), color_rgba[3]]
            material = _surface({"baseColorFactor": factor})
            if color_rgba[3] < 1.0:
                material["alphaMode"] = "BLEND"
            self._materials[color_rgba] = self._add("materials", material)
        return self._materials[color_rgba]

    def add_tiles(self, png: bytes) -> int:
        """Add a material of a picture that is repeated in all directions; returns its number."""
        image = {"bufferView": self._buffer.add_view(png), "mimeType": "image/png"}
        filters = {"magFilter": _LINEAR, "minFilter": _LINEAR_OF_SMALLER_ONES}
        sampler = filters | {"wrapS": _REPEAT, "wrapT": _REPEAT}
        texture = self._add(
            "textures",
            {"source": self._add("images", image), "sampler": self._add("samplers", sampler)},
        )
        return self._add("materials", _surface({"baseColorTexture": {"index": texture}}))

    def to_gltf(self) -> bytes:
        """The document as text, with its numbers in it as base64."""
        content = base64.b64encode(bytes(self._buffer)).decode()
        return self._json({"uri": "data:application/octet-stream;base64," + content})

    def to_glb(self) -> bytes:
        """The document in its binary form."""
        text = self._json({})
        text += b" " * (-len(text) % 4)
        chunks = [(_JSON_CHUNK, text)]
        if self._buffer:
            binary = bytes(self._buffer)
            chunks.append((_BINARY_CHUNK, binary + b"\0" * (-len(binary) % 4)))
        body = b"".join(struct.pack("<II", len(part), kind) + part for kind, part in chunks)
        return struct.pack("<III", _GLB_MAGIC, 2, 12 + len(body)) + body

    def _json(self, buffer: dict[str, str]) -> bytes:
        content: dict[str, Any] = {**self._head, "scenes": [{"nodes": self._roots}]}
        content |= self._parts
        if self._channels:
            animation = {"name": "motion", "channels": self._channels, "samplers": self._samplers}
            content["animations"] = [animation]
        if self._buffer:
            content["buffers"] = [{**buffer, "byteLength": len(self._buffer)}]
        return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()

    def _add(self, part: str, entry: dict[str, Any]) -> int:
        entries = self._parts.setdefault(part, [])
        entries.append(entry)
        return len(entries) - 1

    def _unused(self, name: str) -> str:
        """A name that no node has: browsers tell by it which node is to move."""
        numbered = (f"{name}_{number}" for number in count(2))
        unused = next(each for each in chain((name,), numbered) if each not in self._names)
        self._names.add(unused)
        return unused


def _surface(color: dict[str, Any]) -> dict[str, Any]:
    """A material of a colour, or a texture, which is no metal."""
    return {"pbrMetallicRoughness": {**color, "metallicFactor": 0.0, "roughnessFactor": _ROUGHNESS}}
