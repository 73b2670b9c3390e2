"""The mesh files of a URDF: found by their names, which are made absolute."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

from msgs_config import files
from msgs_config.errors import CharacterError

MAX_MESH_BYTES = 64 * 1024 * 1024


def resolve_meshes(robot: ElementTree.Element, urdf: Path) -> None:
    """Replace the file names of all meshes of a URDF's links by absolute paths.

    Raises:
        CharacterError: a mesh does not exist or is too large; names the file, link and path.
    """
    for link in robot.findall("link"):
        for mesh in link.iter("mesh"):
            try:
                mesh.set("filename", str(_find(mesh.get("filename", ""), urdf)))
            except CharacterError as error:
                raise CharacterError(f"{urdf}: link {link.get('name')!r}: {error}") from error


def _find(name: str, urdf: Path) -> Path:
    if not name or "\0" in name:
        raise CharacterError(f"mesh without a usable file name: {name!r}")
    candidates = list(_candidates(name, urdf))
    for path in candidates:
        try:
            if path.is_file():
                if path.stat().st_size > MAX_MESH_BYTES:
                    raise CharacterError(f"mesh {path} is larger than {MAX_MESH_BYTES >> 20} MiB")
                return path.absolute()
        except OSError:  # such as a name that is too long
            continue
    raise CharacterError(f"mesh {name!r} does not exist; looked for {candidates[0]}")


def _candidates(name: str, urdf: Path) -> Iterator[Path]:
    """Where a mesh may lie: `package://` in its package, else below a folder above the URDF."""
    if name.startswith("file://"):
        yield Path(unquote(urlsplit(name).path))
    elif name.startswith("package://"):
        with suppress(CharacterError):
            yield files.resolve(name, urdf.parent, CharacterError)
        # as PyBullet does, and as packages lie in a workspace that is not installed
        for folder in urdf.absolute().parents:
            yield folder / name.removeprefix("package://")
    else:
        yield urdf.parent / name
