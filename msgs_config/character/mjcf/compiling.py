"""An MJCF file as MuJoCo compiles it: defaults, includes, `fromto`, angles and inertia resolved.

MuJoCo refuses a file of which a mesh or a picture is missing. A character may do without: of what
is only seen, and with `collision: none` of all shapes. So a shape whose mesh is missing is compiled
as a small ball, where that cannot change an inertia.
"""

import math
import os
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from msgs_config import files
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed
from msgs_config.errors import CharacterError
from msgs_config.file_kinds import root_tag

SUFFIXES = (".xml", ".mjcf")
_ROOT = "mujoco"
_STAND_IN = 1e-3  # m, the radius of the ball in the place of a mesh that is missing
_MESH = mujoco.mjtGeom.mjGEOM_MESH
_OTHERS = re.compile(r"""<(?:include|model)\s[^>]*?\bfile\s*=\s*["']([^"']+)""")
_HEIGHTS = mujoco.mjtGeom.mjGEOM_HFIELD


class CompiledMjcf(NamedTuple):
    """An MJCF file."""

    path: Path
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    stand_ins: dict[int, str]
    """The mesh of each shape that was compiled as a ball, by the shape's number."""
    remarks: tuple[LeftOut, ...]
    """A line for each kind of what had to be taken away before it could be compiled."""

    def name(self, kind: str, number: int) -> str:
        """The name of a thing of a kind such as `body`; one without a name gets its number."""
        return str(getattr(self.model, kind)(number).name) or f"{kind}_{number}"

    def mesh_file(self, number: int) -> str:
        """The file of a mesh as a URDF beside the MJCF names it; empty for one without a file.

        That of an attached model is where MuJoCo found it: beside that model's own file.
        """
        begin = int(self.model.mesh_pathadr[number])
        if begin < 0:
            return ""
        file = self.model.paths[begin:].split(b"\0", 1)[0].decode()
        return os.path.relpath(file, self.path.parent)


def is_mjcf(path: Path) -> bool:
    """Whether a file is one of MuJoCo: an XML whose root is `<mujoco>`.

    Raises:
        CharacterError: the file cannot be read.
    """
    if path.suffix.lower() not in SUFFIXES or not path.is_file():
        return False
    # MuJoCo reads files that are not quite XML
    return root_tag(files.read_xml(path, CharacterError).text) == _ROOT


def compile_mjcf(path: Path) -> CompiledMjcf:
    """Compile a file.

    Raises:
        CharacterError: MuJoCo refuses it, or a mesh is missing on which an inertia depends.
    """
    try:
        return _compile(path)
    except ValueError as error:  # a part of a scene may name what is in the rest of it
        reason = _one_line(error)
        with suppress(ValueError):
            return _compile(path, reason)
        raise CharacterError(f"{path}: not usable by MuJoCo: {reason}") from error


def _compile(path: Path, refused: str = "") -> CompiledMjcf:
    """Compile a file; without sensors, pairs and excludes, if it was refused with them.

    Raises:
        CharacterError: a mesh is missing on which an inertia depends.
        ValueError: MuJoCo refuses it.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            spec = mujoco.MjSpec.from_file(str(path))
            remarks = [*_take_away_pictures(spec), *_take_away_heights(spec)]
            if refused:
                remarks.append(_take_away_references(spec, refused))
            balls = _replace_missing(path, spec)
            model = spec.compile()
        except mujoco.FatalError as error:
            raise ValueError(str(error)) from error
    stand_ins = {int(geom.id): name for geom, name in balls}
    return CompiledMjcf(path, spec, model, stand_ins, tuple(remarks))


def _take_away_references(spec: mujoco.MjSpec, reason: str) -> LeftOut:
    for each in (*spec.sensors, *spec.pairs, *spec.excludes):
        spec.delete(each)
    return LeftOut("refused", f"left out: all <sensor>, <pair> and <exclude>: {reason}")


def _mesh_path(folders: Sequence[Path], spec: mujoco.MjSpec, mesh: mujoco.MjsMesh) -> Path:
    """Where a mesh is; beside the first of the files if it is missing."""
    name = Path(mesh.file).name if spec.strippath else mesh.file
    place = Path(mesh.compiler.meshdir or spec.compiler.meshdir or "", name)
    found = (folder / place for folder in folders if _is_there(folder / place))
    return next(found, folders[0] / place)


def _folders(path: Path, seen: set[Path]) -> Iterator[Path]:
    """The folders of a file, and of all that it includes or attaches: meshes may lie in each."""
    if path in seen or not path.is_file():
        return
    seen.add(path)
    yield path.parent
    for name in _OTHERS.findall(path.read_text(errors="replace")):
        yield from _folders(path.parent / name, seen)


def _take_away_pictures(spec: mujoco.MjSpec) -> list[LeftOut]:
    """Remove what only pictures need and whose files may be missing; a line of each kind."""
    remarks = []
    names = [each.name for each in spec.textures]
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)
    skins = [each.name for each in spec.skins]
    for skin in list(spec.skins):
        spec.delete(skin)
    for kind, found in (("texture", names), ("skin", skins)):
        if found:
            remarks.append(LeftOut(kind, f"left out: <{kind}> ({len(found)}){_named(found)}"))
    return remarks


def _take_away_heights(spec: mujoco.MjSpec) -> list[LeftOut]:
    """Remove fields of heights, whose files may be missing; their geoms become balls."""
    names = [each.name for each in spec.hfields]
    for geom in spec.geoms:
        if geom.type == _HEIGHTS:
            _make_ball(geom)
    for each in list(spec.hfields):
        spec.delete(each)
    return [LeftOut("hfield", f"left out: <hfield> ({len(names)}){_named(names)}")] if names else []


def _replace_missing(path: Path, spec: mujoco.MjSpec) -> list[tuple[mujoco.MjsGeom, str]]:
    """Replace shapes by balls where their files are missing; each with the mesh that it had."""
    folders = list(_folders(path, set()))
    missing = {
        each.name: each
        for each in spec.meshes
        if each.file and not _is_there(_mesh_path(folders, spec, each))
    }
    balls = []
    for geom in spec.geoms:
        if geom.meshname in missing:
            mesh = missing[geom.meshname]
            if _weighs(spec, geom):
                raise CharacterError(
                    f"{path}: body '{geom.parent.name}' has the inertia of a mesh that is missing: "
                    f"{_mesh_path(folders, spec, mesh)}"
                )
            balls.append((geom, os.path.relpath(_mesh_path(folders, spec, mesh), path.parent)))
            _make_ball(geom)
    for each in missing.values():
        spec.delete(each)
    return balls


def _is_there(file: Path) -> bool:
    try:
        return file.is_file() and not files.is_lfs_pointer(file)
    except OSError:
        return False


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether the inertia of a body follows from this shape."""
    body, compiler = geom.parent, spec.compiler
    always = compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if (body.explicitinertial and not always) or not _moves(body):
        return False
    least, most = compiler.inertiagrouprange
    mass = geom.density if math.isnan(geom.mass) else geom.mass
    return bool(mass) and least <= geom.group <= most


def _moves(body: mujoco.MjsBody) -> bool:
    """Whether a joint moves a body, or one that it is fixed to."""
    while body is not None and body.name != "world":
        if body.joints:
            return True
        body = body.parent
    return False


def _make_ball(geom: mujoco.MjsGeom) -> None:
    geom.type, geom.meshname, geom.hfieldname = mujoco.mjtGeom.mjGEOM_SPHERE, "", ""
    geom.size, geom.mass, geom.density = np.full(3, _STAND_IN), 0.0, 0.0
    geom.fromto = np.full(6, math.nan)


def _named(names: list[str]) -> str:
    found = listed(name for name in names if name)
    return f": {found}" if found else ""


def _one_line(error: Exception) -> str:
    return "; ".join(line.strip() for line in str(error).splitlines() if line.strip())[:500]
