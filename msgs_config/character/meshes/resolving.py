"""The mesh files of a URDF: found by their names, which are made absolute."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

from msgs_config import files
from msgs_config.character.model import UrdfOptions
from msgs_config.digests import sha256_of
from msgs_config.errors import CharacterError

MAX_MESH_BYTES = 64 * 1024 * 1024
_REMEDY = "'collision: none' does without"


class ResolvedMeshes(NamedTuple):
    """A URDF whose meshes were found."""

    robot: ElementTree.Element
    """A copy of its root, in which the meshes of its links have absolute paths."""
    warnings: tuple[str, ...]
    """One if shapes that are only seen are left out."""


def resolve_meshes(loading: UrdfOptions) -> ResolvedMeshes:
    """Find the meshes of a URDF. Shapes that are only seen are left out where theirs are missing.

    Where nothing collides that goes for all shapes.

    Raises:
        CharacterError: a mesh to collide with does not exist, is too large or a Git LFS pointer;
            names the file, link and path.
    """
    robot, urdf = deepcopy(loading.robot), loading.urdf_path
    missing: list[str] = []
    for link in robot.findall("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            try:
                for mesh in part.iter("mesh"):
                    mesh.set("filename", str(_find(mesh.get("filename", ""), urdf)))
            except CharacterError as error:
                line = f"link {link.get('name')!r}: {error}"
                if part.tag == "collision" and loading.collisions:
                    raise CharacterError(f"{urdf}: {line}; {_REMEDY}") from error
                link.remove(part)
                missing += [line] if part.tag == "visual" else []
    if not missing:
        return ResolvedMeshes(robot, ())
    others = f"; and {len(missing) - 1} more" if len(missing) > 1 else ""
    return ResolvedMeshes(robot, (f"shapes that are only seen are left out: {missing[0]}{others}",))


def collision_meshes(loading: UrdfOptions) -> dict[str, str]:
    """SHA-256 of each mesh that is collided with, hexadecimal, by the name that the URDF gives it.

    Raises:
        CharacterError: a mesh does not exist or cannot be read.
    """
    if not loading.collisions:
        return {}
    names = {mesh.get("filename", "") for mesh in loading.robot.iterfind("link/collision//mesh")}
    return {name: _hash_of(_find(name, loading.urdf_path)) for name in sorted(names)}


def check_collision_meshes(loading: UrdfOptions, known: Mapping[str, str]) -> None:
    """Check that the meshes are those whose hashes are known; see `collision_meshes`.

    Raises:
        CharacterError: one is missing or another one; names its path.
    """
    for name, digest in collision_meshes(loading).items():
        if known.get(name, digest) != digest:
            path = _find(name, loading.urdf_path)
            raise CharacterError(f"mesh {path} is not the one that it was: its content differs")


def _hash_of(path: Path) -> str:
    try:
        return sha256_of(path)  # a node says it again when its parameters change
    except OSError as error:
        raise CharacterError(f"mesh {path}: {error.strerror}") from error


def _find(name: str, urdf: Path) -> Path:
    if not name or "\0" in name:
        raise CharacterError(f"mesh without a usable file name: {name!r}")
    candidates = list(_candidates(name, urdf))
    for path in candidates:
        try:
            if path.is_file():
                if path.stat().st_size > MAX_MESH_BYTES:
                    raise CharacterError(f"mesh {path} is larger than {MAX_MESH_BYTES >> 20} MiB")
                if files.is_lfs_pointer(path):
                    raise CharacterError(f"mesh {path} {files.LFS_REASON}")
                return path.absolute()
        except OSError:  # such as a name that is too long
            continue
    above = f", and so on up to {candidates[-1]}" if len(candidates) > 1 else ""
    raise CharacterError(f"mesh {name!r} does not exist; looked for {candidates[0]}{above}")


def _candidates(name: str, urdf: Path) -> Iterator[Path]:
    """Where a mesh may lie: `package://` in its package, else below a folder above the URDF."""
    if name.startswith("file://"):
        yield Path(unquote(urlsplit(name).path))
    elif name.startswith("package://"):
        with suppress(CharacterError):
            yield files.resolve(name, urdf.parent, CharacterError)
        # Above the URDF, as PyBullet looks, and as packages lie in a workspace not installed.
        for folder in urdf.absolute().parents:
            yield folder / name.removeprefix("package://").lstrip("/")
        # In the package that the URDF lies in, whose folder may have another name.
        yield urdf.absolute().parents[1] / "/".join(name.split("/")[3:])
    else:
        yield urdf.parent / name
