"""Files from outside: found by name, read as data with a limit on size, never evaluated."""

import codecs
import importlib.util
import re
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.parsers import expat

import yaml

from msgs_config.errors import ActuatedCharactersError

_find_in_ros: Callable[[str], str] | None = None
with suppress(ImportError):  # there may be no ROS
    from ament_index_python.packages import get_package_share_directory as _find_in_ros

MAX_FILE_BYTES = 16 * 1024 * 1024
MAX_YAML_CHARACTERS = 128 * 1024
MAX_XML_CHARACTERS = 2 * 1024 * 1024
MAX_XML_NESTING = MAX_YAML_NESTING = 64  # levels
_PACKAGE = "package://"
LFS_POINTER = b"version https://git-lfs.github.com/spec/"
_REMEDIES = {
    "pybullet_data": "; it comes with PyBullet, and alone by: "
    f"{sys.executable} -m msgs_config.fetch_robots"
}
"""By the package's name, how to get one that the shipped characters' files name."""
_LFS_POINTER_BYTES = 1024  # a pointer is smaller than that, by its specification
_BYTE_ORDER_MARKS = (  # UTF-32's little-endian one begins as UTF-16's does
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
LFS_REMEDY = "'git lfs pull' in its repository gets the file"
LFS_REASON = f"is a Git LFS pointer, not the file itself; {LFS_REMEDY}"
_DECLARED_ENCODING = re.compile(rb"""\s*<\?xml[^>]*?\sencoding\s*=\s*["']([A-Za-z0-9._:-]+)["']""")


def resolve(path: str, relative_to: Path, error: type[ActuatedCharactersError]) -> Path:
    """The path that `package://NAME/...`, an absolute or a relative path stands for.

    NAME is a ROS package or an importable Python package, such as `pybullet_data`, which is not
    imported.

    Raises:
        error: the package is not installed.
    """
    if not path.startswith(_PACKAGE):
        return relative_to / path
    package, _, inside = path.removeprefix(_PACKAGE).partition("/")
    return _package_directory(package, error) / inside


def _package_directory(package: str, error: type[ActuatedCharactersError]) -> Path:
    with suppress(LookupError, ValueError, OSError):  # OSError: no ROS environment
        if _find_in_ros is not None:
            return Path(_find_in_ros(package))
    with suppress(ValueError):  # a module that was never found, such as the main one
        spec = importlib.util.find_spec(package) if package.isidentifier() else None
        if spec is not None and spec.submodule_search_locations:
            return Path(spec.submodule_search_locations[0])
    remedy = _REMEDIES.get(package, "")
    raise error(f"package '{package}' is not installed{remedy}")


def read_text(path: Path, error: type[ActuatedCharactersError], most: int | None = None) -> str:
    """The text of a file of so many bytes at most, by default `MAX_FILE_BYTES`.

    Raises:
        error: it is missing, unreadable, too large, a Git LFS pointer or no text in UTF-8.
    """
    try:
        return _universal_newlines(_read_bytes(path, error, most).decode("utf-8"))
    except UnicodeDecodeError as cause:
        raise error(f"{path}: not a text file") from cause


def _read_bytes(path: Path, error: type[ActuatedCharactersError], most: int | None) -> bytes:
    most = MAX_FILE_BYTES if most is None else most
    try:
        if path.exists() and not path.is_file():
            raise error(f"{path}: not a file")
        if path.stat().st_size > most:
            raise error(f"{path}: larger than {most >> 20} MiB")
        raw = path.read_bytes()
    except (OSError, ValueError) as cause:  # ValueError: a NUL in the path
        reason = cause.strerror if isinstance(cause, OSError) else "not a text file"
        raise error(f"{path}: {reason}") from cause
    if raw.startswith(LFS_POINTER):
        raise error(f"{path} {LFS_REASON}")
    return raw


def is_lfs_pointer(path: Path) -> bool:
    """Whether a file is the pointer that Git has in place of one of Git LFS.

    Raises:
        OSError: it cannot be read.
    """
    if path.stat().st_size > _LFS_POINTER_BYTES:
        return False
    with path.open("rb") as file:
        return file.read(len(LFS_POINTER)) == LFS_POINTER


class XmlText(NamedTuple):
    """The text of an XML file."""

    text: str
    misread: str
    """Says so if the file is not in the encoding that it declares; else empty."""


def read_xml(path: Path, error: type[ActuatedCharactersError]) -> XmlText:
    """The text of an XML file, in whatever encoding its byte order mark or declaration names.

    One that is not in its encoding, as files with comments in another language are, is read byte
    by byte (ISO-8859-1): all that XML itself and its numbers are written with is ASCII.

    Raises:
        error: it is missing, unreadable, too large, a Git LFS pointer or no text.
    """
    raw = _read_bytes(path, error, None)
    text, misread = _decode_xml(path, raw)
    text = text.rstrip("\0")  # PyBullet's own files end in NUL
    if "\0" in text:
        raise error(f"{path}: not a text file")
    return XmlText(_universal_newlines(text), misread)


def _decode_xml(path: Path, raw: bytes) -> tuple[str, str]:
    """The text of an XML file's bytes, and a line if they are not in the encoding that it names."""
    mark = next((name for mark, name in _BYTE_ORDER_MARKS if raw.startswith(mark)), None)
    declared = _DECLARED_ENCODING.match(raw)
    encoding = mark or ("utf-8" if declared is None else declared[1].decode())
    if mark is None and encoding.lower().startswith(("utf-16", "utf-32", "ucs")):
        encoding = "utf-8"  # a declaration that can be read byte by byte is wrong
    for each in (encoding, "utf-8"):
        with suppress(LookupError, ValueError):  # LookupError: there is no such encoding
            return raw.decode(each), ""
    reason = f"{path.name} is not {encoding}: it is read byte by byte (ISO-8859-1)"
    return raw.decode("latin-1"), reason


def _universal_newlines(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_yaml_mapping(
    path: Path, text: str, error: type[ActuatedCharactersError]
) -> dict[str, Any]:
    """The mapping at the top of a YAML file's text.

    Raises:
        error: the text is no YAML, is too large, nests too deep, or holds no mapping.
    """
    content = parse_yaml(str(path), text, error)
    if not isinstance(content, dict):
        raise error(f"{path}: must hold a mapping")
    return content


def parse_yaml(
    place: str,
    text: str,
    error: type[ActuatedCharactersError],
    most: int = MAX_YAML_CHARACTERS,
) -> Any:
    """The value that a YAML text stands for; numbers are decimal, as in YAML 1.2 and JSON.

    Args:
        place: Where the text comes from, such as a file's path: an error begins with it.
        text: The YAML text.
        error: The class of the error.
        most: Characters of the text that are read at most.

    Raises:
        error: the text is no YAML, is too large, or nests too deep.
    """
    if len(text) > most:
        raise error(f"{place}: larger than {most >> 10} KiB")
    try:
        content = _PlainLoader(text).get_single_data()
    except (yaml.YAMLError, ValueError) as cause:  # ValueError: a number of too many digits
        where = getattr(cause, "problem_mark", None)
        line = f", line {where.line + 1}" if where is not None else ""
        problem = getattr(cause, "problem", None)
        reason = f": {problem[:200]}" if problem else ""
        raise error(f"{place}{line}: not valid YAML{reason}") from cause
    if _nests_too_deep(content):
        raise error(f"{place}: not valid YAML: nested too deep")
    return content


def _nests_too_deep(content: object) -> bool:
    """Whether a value has too many levels, or is within itself: who reads it calls itself."""
    level = [content]
    for _ in range(MAX_YAML_NESTING):
        children = [child for each in level for child in _children(each)]
        level = list({id(child): child for child in children}.values())  # an alias counts once
        if not level:
            return False
    return True


def _children(content: object) -> Iterable[object]:
    if isinstance(content, dict):
        return content.values()
    return content if isinstance(content, list) else ()


_TAG = "tag:yaml.org,2002:"
_NUMBERS = {  # the forms of numbers in YAML 1.2 and JSON
    "int": r"[-+]?[0-9]+",
    "float": r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
}


class _PlainLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Plain data alone.

    PyYAML follows YAML 1.1, where `1e-1` is a text, `010` is eight and `1:30` ninety. Here they
    are 0.1, ten and a text, as in YAML 1.2; dates are texts as well.
    """

    yaml_implicit_resolvers = {  # noqa: RUF012 (PyYAML's own name)
        first: [each for each in resolvers if each[0] in (_TAG + "bool", _TAG + "null")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        # a mapping that is merged (`<<`) is copied: ten merges of ten, a few times over, are
        # more than fits into memory. Left alone, the key `<<` is no valid one.
        pass


for _kind, _pattern in _NUMBERS.items():
    _regexp = re.compile(rf"(?:{_pattern})\Z")
    _PlainLoader.add_implicit_resolver(_TAG + _kind, _regexp, [*"-+.0123456789"])
_PlainLoader.add_constructor(f"{_TAG}int", lambda _, node: int(node.value))


def dump_yaml(content: Any, *, sort_keys: bool = False) -> str:
    """The YAML text of plain data, as PyYAML writes it; by libyaml where it is there, the same.

    Raises:
        yaml.YAMLError: it holds something that is no plain data.
    """
    return str(yaml.dump(content, Dumper=_PlainDumper, sort_keys=sort_keys))


_PlainDumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def parse_xml(path: Path, text: str, error: type[ActuatedCharactersError]) -> ElementTree.Element:
    """The root element of an XML file's text, which may end in a NUL as PyBullet's own do.

    Names stay as they are written, prefix and all: as robots' readers have it, a prefix that is not
    declared is no error, and a default name space alters nothing.

    Raises:
        error: the text is no XML, declares a document type, or is too deep or too large.
    """
    if len(text) > MAX_XML_CHARACTERS:
        raise error(f"{path}: larger than {MAX_XML_CHARACTERS >> 20} MiB")
    try:
        root = deepcopy(_parse_xml(text))
    except (expat.ExpatError, ValueError) as cause:  # ValueError: a lone surrogate
        raise error(f"{path}: not valid XML: {str(cause)[:200]}") from cause
    level = [root]
    for _ in range(MAX_XML_NESTING):
        level = [child for element in level for child in element]
    if level:  # the engine's parser calls itself for each level
        raise error(f"{path}: not valid XML: deeper than {MAX_XML_NESTING} elements")
    return root


@lru_cache(maxsize=4)  # a node's start reads its character's URDF several times
def _parse_xml(text: str) -> ElementTree.Element:
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = _refuse_document_type
    parser.Parse(text.strip("\ufeff\0 \t\r\n"), True)
    return builder.close()


def _refuse_document_type(name: str, *_: object) -> None:
    """By the entities of a document type a small text becomes a large one; it comes before them."""
    page = ": it is a web page, not the file itself" if name.lower() == "html" else ""
    raise ValueError(f"a document type (DOCTYPE) is not allowed{page}")
