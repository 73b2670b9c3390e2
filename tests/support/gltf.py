"""An own reader of glTF 2.0: nodes, and where they and skins are when its animation plays.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import base64
import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TYPES: dict[int, type[np.number[Any]]] = {
    5121: np.uint8,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Gltf:
    """A file's JSON and its one buffer."""

    content: dict[str, Any]
    buffer: bytes

    @classmethod
    def of_glb(cls, raw: bytes) -> "Gltf":
        """From the binary form: header, a chunk of JSON, a chunk of numbers."""
        assert struct.unpack_from("<4sII", raw) == (b"glTF", 2, len(raw))
        length, kind = struct.unpack_from("<I4s", raw, 12)
        assert kind == b"JSON" and length % 4 == 0
        start = 20 + length
        size, kind = struct.unpack_from("<I4s", raw, start)
        assert kind == b"BIN\0" and size % 4 == 0 and start + 8 + size == len(raw)
        return cls(json.loads(raw[20:start]), raw[start + 8 :])

    @classmethod
    def of_text(cls, raw: bytes) -> "Gltf":
        """From the form of text, with the numbers in it."""
        content = json.loads(raw)
        head, _, data = content["buffers"][0]["uri"].partition(",")
        assert head == "data:application/octet-stream;base64"
        return cls(content, base64.b64decode(data))

    def numbers(self, accessor: int) -> NDArray[Any]:
        """The rows (m, width) of an accessor."""
        entry = self.content["accessors"][accessor]
        view, width = self.content["bufferViews"][entry["bufferView"]], WIDTHS[entry["type"]]
        kind, start = TYPES[entry["componentType"]], view["byteOffset"]
        flat = np.frombuffer(self.buffer, kind, entry["count"] * width, start)
        assert flat.nbytes <= view["byteLength"] and start % 4 == 0
        return flat.reshape(-1, width)

    def node(self, name: str) -> int:
        """The number of the only node of a name."""
        (number,) = [k for k, node in enumerate(self.content["nodes"]) if node["name"] == name]
        return number

    def poses(self, time: float) -> list[Matrix]:
        """Where each node is in the scene, (4, 4), when the animation is at a time in s."""
        local = [dict(node) for node in self.content["nodes"]]
        for animation in self.content.get("animations", []):
            for channel in animation["channels"]:
                sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
                local[target["node"]][target["path"]] = self._value(sampler, time)
        poses: dict[int, Matrix] = {}
        stack = [(number, np.eye(4)) for number in self.content["scenes"][0]["nodes"]]
        while stack:
            number, above = stack.pop()
            poses[number] = above @ _matrix(local[number])
            stack += [(child, poses[number]) for child in local[number].get("children", [])]
        return [poses[number] for number in range(len(local))]

    def skinned(self, node: int, time: float) -> list[Matrix]:
        """Where the vertices (m, 3) of a skinned mesh are at a time, part by part: linear blend."""
        content = self.content
        skin, poses = content["skins"][content["nodes"][node]["skin"]], self.poses(time)
        binds = self.numbers(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        moved = np.array([poses[joint] @ binds[k] for k, joint in enumerate(skin["joints"])])
        parts = []
        for primitive in content["meshes"][content["nodes"][node]["mesh"]]["primitives"]:
            places, joints, shares = (
                self.numbers(primitive["attributes"][key])
                for key in ("POSITION", "JOINTS_0", "WEIGHTS_0")
            )
            whole = np.column_stack((places, np.ones(len(places))))
            blended = np.einsum("mk,mkij,mj->mi", shares, moved[joints], whole)
            parts.append(blended[:, :3])
        return parts

    def _value(self, sampler: dict[str, Any], time: float) -> NDArray[Any]:
        times, values = self.numbers(sampler["input"])[:, 0], self.numbers(sampler["output"])
        after = int(np.searchsorted(times, time, side="right").clip(1, max(len(times) - 1, 1)))
        if len(times) == 1 or time <= times[0]:
            return values[0]
        share = min((time - times[after - 1]) / (times[after] - times[after - 1]), 1.0)
        if sampler["interpolation"] == "STEP":
            share = float(time >= times[after])
        mixed = (1.0 - share) * values[after - 1] + share * values[after]
        return mixed / np.linalg.norm(mixed) if values.shape[1] == 4 else mixed


def _matrix(node: dict[str, Any]) -> Matrix:
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose = np.eye(4)
    pose[:3, :3] = np.array(turn) * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    pose[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return pose


def assert_valid(gltf: Gltf) -> None:
    """What the specification demands and readers forgive or not: bounds, unit lengths, indices."""
    content = gltf.content
    assert content["asset"]["version"] == "2.0"
    assert content["buffers"][0]["byteLength"] <= len(gltf.buffer) < 2**32
    used = {accessor for mesh in content.get("meshes", []) for accessor in _check_mesh(gltf, mesh)}
    for skin in content.get("skins", []):
        assert len(gltf.numbers(skin["inverseBindMatrices"])) == len(skin["joints"])
        used.add(skin["inverseBindMatrices"])
    for node in content["nodes"]:
        _check_skin(gltf, node)
    for animation in content["animations"]:
        targets = [
            (each["target"]["node"], each["target"]["path"]) for each in animation["channels"]
        ]
        assert len(set(targets)) == len(targets)
        for sampler in animation["samplers"]:
            times, values = gltf.numbers(sampler["input"]), gltf.numbers(sampler["output"])
            assert (
                len(times) == len(values) and times[0] >= 0.0 and (np.diff(times[:, 0]) > 0).all()
            )
            used |= {sampler["input"], sampler["output"]}
            if values.shape[1] == 4:
                np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1.0, atol=1e-6)
    assert used == set(range(len(content["accessors"])))
    for number, accessor in enumerate(content["accessors"]):
        assert accessor["count"] > 0 and np.isfinite(gltf.numbers(number)).all()
        for key, bound in (("min", np.min), ("max", np.max)):
            if key in accessor:
                assert accessor[key] == bound(gltf.numbers(number), axis=0).tolist()
    names = [node["name"] for node in content["nodes"]]
    assert len(set(names)) == len(names)


def _check_mesh(gltf: Gltf, mesh: dict[str, Any]) -> set[int]:
    used = set()
    for primitive in mesh["primitives"]:
        places, normals = primitive["attributes"]["POSITION"], primitive["attributes"]["NORMAL"]
        assert {"min", "max"} <= set(gltf.content["accessors"][places])
        lengths = np.linalg.norm(gltf.numbers(normals), axis=1)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-6)
        corners = gltf.numbers(primitive["indices"])
        assert len(corners) % 3 == 0 and corners.max() < len(gltf.numbers(places)) == len(lengths)
        used |= {*primitive["attributes"].values(), primitive["indices"]}
    return used


def _check_skin(gltf: Gltf, node: dict[str, Any]) -> None:
    """A skinned mesh has joints of its skin alone, at most four a vertex, of shares of sum one."""
    if "skin" not in node:
        return
    count = len(gltf.content["skins"][node["skin"]]["joints"])
    for primitive in gltf.content["meshes"][node["mesh"]]["primitives"]:
        joints = gltf.numbers(primitive["attributes"]["JOINTS_0"])
        shares = gltf.numbers(primitive["attributes"]["WEIGHTS_0"])
        assert joints.shape == shares.shape == (len(joints), 4)
        assert joints.max() < count and (joints[shares == 0.0] == 0).all() and (shares >= 0).all()
        np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=4e-7)
