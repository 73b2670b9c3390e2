"""The text of a URDF from its file, in whatever encoding, or from a xacro, which is expanded."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from msgs_config import files
from msgs_config.character.urdf.file_formats.formats import CHARACTER_FILE, URDF_SUFFIXES
from msgs_config.errors import CharacterError
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.runtime.extras import require_extra
from msgs_config.runtime.fork_safe import fork_safe_lock

XACRO = ".xacro"
_FOLDERS_ABOVE = 6  # how many folders above a file are looked through for a package
_xacro_lock = fork_safe_lock()  # the package xacro keeps what it is at in globals


def read_urdf_text(path: Path, arguments: Mapping[str, str] | None = None) -> files.XmlText:
    """The text of a URDF's file; that of a xacro is expanded with these arguments.

    Raises:
        CharacterError: it cannot be read or expanded, or is of another format; says which.
    """
    if path.suffix.lower() == XACRO:
        return files.XmlText(_expand(path, arguments or {}), "")
    refuse_other_kind(path, CHARACTER_FILE, URDF_SUFFIXES, CharacterError)
    return files.read_xml(path, CharacterError)


def _expand(path: Path, arguments: Mapping[str, str]) -> str:
    files.read_xml(path, CharacterError)  # raises an error that names what is no file, or too large
    require_extra("xacro", f"{path}: to expand a xacro", CharacterError)
    import xacro
    from xacro import substitution_args

    file = path.absolute()
    with _xacro_lock:
        usual = substitution_args._eval_find  # of `$(find NAME)`: in installed ROS packages alone
        substitution_args._eval_find = lambda name: _find_package(name, file)
        try:
            return str(xacro.process_file(str(file), mappings=dict(arguments), verbosity=0).toxml())
        except Exception as error:  # whatever an expression in the file raises
            reason = (" ".join(str(error).split()) or type(error).__name__)[:500]
            remedy = "; the key 'xacro' of a .yaml file gives arguments" * ("argument" in reason)
            raise CharacterError(f"{path}: xacro: {reason}{remedy}") from error
        finally:
            substitution_args._eval_find = usual


def _find_package(name: str, near: Path) -> str:
    """The folder of a ROS or Python package: installed, or in the workspace that a file lies in.

    There a package is a folder of its name, or one whose `package.xml` gives it this name.

    Raises:
        CharacterError: it is nowhere.
    """
    try:
        return str(files.resolve(f"package://{name}", near, CharacterError))
    except CharacterError:
        for above in list(near.parents)[:_FOLDERS_ABOVE]:
            for folder in (above, *sorted(each.parent for each in above.glob("*/package.xml"))):
                if name in (folder.name, _package_name(folder)):
                    return str(folder)
            if (above / name).is_dir():
                return str(above / name)
        raise


def _package_name(folder: Path) -> str | None:
    try:
        return ElementTree.parse(folder / "package.xml").findtext("name", "").strip()
    except (OSError, ElementTree.ParseError):
        return None
