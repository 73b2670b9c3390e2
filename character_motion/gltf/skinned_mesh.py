"""The skinned meshes of a glTF file as one, in the pose in which they were bound to joints."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from character_motion.gltf.reading import GlbFile, Holding
from character_motion.gltf.triangle_colors import TriangleColors
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import SkinError
from msgs_config.geometry.surface import Surface

MOST_VERTICES, MOST_TRIANGLES, MOST_JOINTS = 200_000, 400_000, 1024
_TRIANGLES = 4  # the mode of a primitive
_DEEPEST = 512  # of nodes below each other
_FARTHEST = 1e9  # of a vertex or a joint from the origin, in the file's unit of length
_MOST_SETS = 4  # of four joints each, of a vertex


@dataclass(frozen=True)
class SkinnedMesh:
    """One mesh, y up and z ahead, in the file's unit of length; joints come after their parents."""

    names: tuple[str, ...]  # of the joints (j,)
    parents: tuple[int, ...]  # (j,), the nearest joint above; -1: none
    places: FloatArray  # (j, 3), where they are
    surface: Surface
    joints: IntArray  # (m, 4 s): what moves each vertex
    weights: FloatArray  # (m, 4 s), of sum one
    colors: FloatArray  # (k, 3): red, green, blue of each triangle, 0 to 1, with sRGB's gamma


class _Piece(NamedTuple):
    """One primitive."""

    surface: Surface
    joints: IntArray
    weights: FloatArray
    colors: FloatArray


def read_skinned_mesh(file: GlbFile) -> SkinnedMesh:
    """All meshes of a file that have a skin; others are left out, as is the animation.

    Raises:
        SkinError: it has none, or too much, or its content does not hold together.
    """
    with Holding(file), np.errstate(all="ignore"):
        mesh = _Reader(file).mesh()
    if not all((np.abs(each) <= _FARTHEST).all() for each in (mesh.places, *mesh.surface[:2])):
        raise file.damaged(f"its mesh or its joints are farther away than {_FARTHEST:g}")
    if not np.isfinite(mesh.colors).all():
        raise file.damaged("a colour of it is no number")
    return mesh


class _Reader:
    """Goes through the nodes of a file."""

    def __init__(self, file: GlbFile) -> None:
        self._file, self._nodes = file, file.entries("nodes")
        self._parents, self._depths = _tree(file, self._nodes)
        if not file.entries("meshes"):
            raise SkinError(f"{file.path} has no mesh")
        self._skinned = [node for node in self._nodes if "skin" in node and "mesh" in node]
        if not self._skinned:
            raise SkinError(
                f"{file.path} has no mesh with a skin: bind it to bones before it is exported"
            )
        self._joints = self._find_joints()
        self._colors = TriangleColors(file)
        self._worlds: dict[int, FloatArray] = {}
        self._rows = {node: row for row, node in enumerate(self._joints)}

    def mesh(self) -> SkinnedMesh:
        """What is there, as one mesh."""
        places = np.full((len(self._joints), 3), np.nan)
        pieces: list[_Piece] = []
        for node in self._skinned:
            joints, turn, own = self._skin(node["skin"])
            new = np.isnan(places[joints, 0])
            places[joints[new]] = own[new]
            for piece in self._pieces(node["mesh"], joints, turn):
                pieces.append(piece)
                self._check_size(pieces)
        if not sum(len(each.colors) for each in pieces):
            raise SkinError(f"{self._file.path} has no triangles with a skin")
        names = tuple(str(self._nodes[j].get("name", f"node_{j}")) for j in self._joints)
        return SkinnedMesh(names, self._joint_parents(), places, *_joined(pieces))

    def _check_size(self, pieces: Sequence[_Piece]) -> None:
        for part, most, what in ((0, MOST_VERTICES, "vertices"), (2, MOST_TRIANGLES, "triangles")):
            count = sum(len(each.surface[part]) for each in pieces)
            if count > most:
                raise SkinError(f"{self._file.path} has {count} {what} or more; at most {most}")

    def _find_joints(self) -> list[int]:
        """The nodes that are joints of the skins in use, parents first."""
        skins = [self._file.entry("skins", node["skin"]) for node in self._skinned]
        wanted = {int(joint) for skin in skins for joint in skin["joints"]}
        if not wanted or min(wanted) < 0 or max(wanted) >= len(self._nodes):
            raise self._file.damaged("a skin has joints that are not there")
        if len(wanted) > MOST_JOINTS:
            raise SkinError(f"{self._file.path} has {len(wanted)} joints; at most {MOST_JOINTS}")
        return sorted(wanted, key=lambda joint: (self._depths[joint], joint))

    def _line(self, node: int) -> Iterator[int]:
        """A node and those above it."""
        while node >= 0:
            yield node
            node = self._parents[node]

    def _joint_parents(self) -> tuple[int, ...]:
        return tuple(
            next((self._rows[node] for node in list(self._line(j))[1:] if node in self._rows), -1)
            for j in self._joints
        )

    def _world(self, node: int) -> FloatArray:
        """Where a node is in the scene as the file is opened (4, 4)."""
        if node not in self._worlds:
            matrix = np.eye(4)
            for each in self._line(node):
                matrix = _local(self._nodes[each]) @ matrix
            self._worlds[node] = matrix
        return self._worlds[node]

    def _skin(self, number: int) -> tuple[IntArray, FloatArray, FloatArray]:
        """A skin's joints (j,), how its mesh lies in the scene (4, 4), and their places (j, 3).

        The mesh is in the pose in which it was bound, with its first joint where the file has it.
        """
        skin = self._file.entry("skins", number)
        nodes = [int(each) for each in skin["joints"]]
        binds = np.tile(np.eye(4), (len(nodes), 1, 1))
        if "inverseBindMatrices" in skin:
            given = self._file.numbers(skin, "inverseBindMatrices", "MAT4")
            binds = given.reshape(-1, 4, 4).swapaxes(1, 2)[: len(nodes)]
        first = min(range(len(nodes)), key=lambda k: self._rows[nodes[k]])
        turn = self._world(nodes[first]) @ binds[first]
        if abs(np.linalg.det(turn[:3, :3])) < np.finfo(float).tiny:
            raise self._file.damaged("its skin has no size")
        places = (turn @ np.linalg.inv(binds))[:, :3, 3]
        return np.array([self._rows[node] for node in nodes]), turn, places

    def _pieces(self, mesh: int, joints: IntArray, turn: FloatArray) -> Iterator[_Piece]:
        for primitive in self._file.entry("meshes", mesh)["primitives"]:
            if primitive.get("mode", _TRIANGLES) != _TRIANGLES:
                continue  # points and lines, which are no surface
            yield self._piece(primitive, joints, turn)

    def _piece(self, primitive: dict[str, Any], joints: IntArray, turn: FloatArray) -> _Piece:
        file, attributes = self._file, primitive["attributes"]
        places = file.numbers(attributes, "POSITION", "VEC3")
        count = len(places)
        corners = np.arange(count)
        if "indices" in primitive:
            corners = file.indices(primitive, "indices", "SCALAR", count)[:, 0]
        triangles = corners.reshape(-1, 3)
        if np.linalg.det(turn[:3, :3]) < 0.0:
            triangles = triangles[:, ::-1]
        vertices = places @ turn[:3, :3].T + turn[:3, 3]
        normals = _normals(vertices, triangles)
        if "NORMAL" in attributes:
            given = file.numbers(attributes, "NORMAL", "VEC3") @ np.linalg.inv(turn[:3, :3])
            lengths = np.linalg.norm(given, axis=1, keepdims=True)
            normals = np.where(lengths > 0.0, given / np.maximum(lengths, 1e-300), normals)
        own, weights = self._weights(attributes, len(joints))
        if not len(vertices) == len(normals) == len(own) == len(weights):
            raise file.damaged("the attributes of a mesh have different lengths")
        colors = self._colors.colors(primitive, triangles)
        used, rows = np.unique(triangles, return_inverse=True)  # parts may share their vertices
        surface = Surface(vertices[used], normals[used], rows.reshape(-1, 3))
        return _Piece(surface, joints[own[used]], weights[used], colors)

    def _weights(self, attributes: dict[str, Any], count: int) -> tuple[IntArray, FloatArray]:
        """What moves each vertex of a mesh, of so many joints (m, 4 s), and how much (m, 4 s)."""
        file = self._file
        sets = [k for k in range(_MOST_SETS) if f"JOINTS_{k}" in attributes]
        if not sets:
            raise SkinError(f"{file.path} has a mesh with a skin whose vertices follow no joint")
        own = np.hstack([file.indices(attributes, f"JOINTS_{k}", "VEC4", count) for k in sets])
        weights = np.hstack([file.numbers(attributes, f"WEIGHTS_{k}", "VEC4") for k in sets])
        weights = np.maximum(weights, 0.0)
        weights[weights.sum(axis=1) == 0.0, 0] = 1.0
        weights /= weights.sum(axis=1, keepdims=True)
        return own, weights


def _joined(pieces: Sequence[_Piece]) -> tuple[Surface, IntArray, FloatArray, FloatArray]:
    """The pieces as one, each vertex with as many joints as any has."""
    width = max(each.joints.shape[1] for each in pieces)
    starts = np.cumsum([0, *(len(each.joints) for each in pieces[:-1])])
    missing = [((0, 0), (0, width - each.joints.shape[1])) for each in pieces]
    padded = list(zip(pieces, missing, strict=True))
    return (
        Surface(
            np.concatenate([each.surface.vertices for each in pieces]),
            np.concatenate([each.surface.normals for each in pieces]),
            np.concatenate(
                [each.surface.triangles + k for each, k in zip(pieces, starts, strict=True)]
            ),
        ),
        np.concatenate([np.pad(each.joints, pad) for each, pad in padded]),
        np.concatenate([np.pad(each.weights, pad) for each, pad in padded]),
        np.concatenate([each.colors for each in pieces]),
    )


def _normals(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Those of the triangles around each vertex, by their area (m, 3)."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    upwards = np.array((0.0, 1.0, 0.0))
    unit: FloatArray = np.where(lengths > 0.0, normals / np.maximum(lengths, 1e-300), upwards)
    return unit


def _tree(file: GlbFile, nodes: Sequence[dict[str, Any]]) -> tuple[list[int], list[int]]:
    """The node above each, -1 for none, and how many are above it."""
    parents, depths = [-1] * len(nodes), [-1] * len(nodes)
    for number, node in enumerate(nodes):
        for child in node.get("children", ()):
            if parents[child] >= 0 or child < 0:
                raise file.damaged(f"node {child} is below two others")
            parents[child] = number
    level = [number for number, parent in enumerate(parents) if parent < 0]
    for depth in range(_DEEPEST):
        for number in level:
            depths[number] = depth
        level = [child for number in level for child in nodes[number].get("children", ())]
    if min(depths, default=0) < 0:
        raise file.damaged(f"nodes are below themselves, or deeper than {_DEEPEST}")
    return parents, depths


def _local(node: dict[str, Any]) -> FloatArray:
    """A node's place in the one above it (4, 4)."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = map(float, node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    turn = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0.0, 0.0, 0.0)), dtype=np.float64)
    return matrix
