"""The text of a URDF from its file, in whatever encoding, or from a xacro, which is expanded."""

import importlib.util
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from msgs_config import files
from msgs_config.character.urdf.file_formats.formats import check_suffix
from msgs_config.errors import CharacterError
from msgs_config.extras import hint

XACRO = ".xacro"
_EXPANDED_BY = "msgs_config.character.urdf.file_formats.xacro_process"
_LONGEST_S = 60.0  # wall time of one expansion


def read_urdf_text(path: Path, arguments: Mapping[str, str] | None = None) -> files.XmlText:
    """The text of a URDF's file; that of a xacro is expanded with these arguments.

    Raises:
        CharacterError: it cannot be read or expanded, or is of another format; says which.
    """
    if path.suffix.lower() == XACRO:
        return files.XmlText(_expand(path, arguments or {}), "")
    check_suffix(path)
    return files.read_xml(path, CharacterError)


def _expand(path: Path, arguments: Mapping[str, str]) -> str:
    files.read_xml(path, CharacterError)  # raises an error that names what is no file, or too large
    if not _has_xacro():
        raise CharacterError(f"{path}: to expand a xacro needs the extra 'xacro': {hint('xacro')}")
    given = [f"{name}:={value}" for name, value in arguments.items()]
    command = [sys.executable, "-P", "-m", _EXPANDED_BY, str(path.absolute()), *given]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_LONGEST_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise CharacterError(f"{path}: xacro is not done after {_LONGEST_S:g} s") from error
    if done.returncode != 0:
        lines = done.stderr.decode(errors="replace").strip().splitlines() or ["no reason given"]
        remedy = (
            "; the key 'xacro' of a .yaml file gives arguments" if "argument" in lines[-1] else ""
        )
        raise CharacterError(f"{path}: xacro: {lines[-1][:500]}{remedy}")
    return done.stdout.decode()


def _has_xacro() -> bool:
    try:
        return importlib.util.find_spec("xacro") is not None
    except ValueError:
        return False
