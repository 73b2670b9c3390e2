"""Files from outside: found by name, read as data with a limit on size, never evaluated."""

import importlib.util
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from msgs_config.errors import ActuatedCharactersError

MAX_FILE_BYTES = 16 * 1024 * 1024
_PACKAGE = "package://"


def resolve(path: str, relative_to: Path, error: type[ActuatedCharactersError]) -> Path:
    """The path that `package://NAME/...`, an absolute or a relative path stands for.

    NAME is a ROS package or an importable Python package, such as `pybullet_data`.

    Raises:
        error: the package is not installed.
    """
    if not path.startswith(_PACKAGE):
        return relative_to / path
    package, _, inside = path.removeprefix(_PACKAGE).partition("/")
    return _package_directory(package, error) / inside


def _package_directory(package: str, error: type[ActuatedCharactersError]) -> Path:
    spec = importlib.util.find_spec(package) if package.isidentifier() else None
    if spec is not None and spec.submodule_search_locations:
        return Path(spec.submodule_search_locations[0])
    try:
        return Path(get_package_share_directory(package))
    except (PackageNotFoundError, ValueError, OSError) as cause:  # OSError: no ROS environment
        raise error(f"package '{package}' is not installed") from cause


def read_text(path: Path, error: type[ActuatedCharactersError]) -> str:
    """The text of a file.

    Raises:
        error: it is missing, unreadable, too large or no text.
    """
    try:
        if path.exists() and not path.is_file():
            raise error(f"{path}: not a file")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise error(f"{path}: larger than {MAX_FILE_BYTES >> 20} MiB")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as cause:
        reason = cause.strerror if isinstance(cause, OSError) else "not a text file"
        raise error(f"{path}: {reason}") from cause


def parse_yaml_mapping(
    path: Path, text: str, error: type[ActuatedCharactersError]
) -> dict[str, Any]:
    """The mapping at the top of a YAML file's text.

    Raises:
        error: the text is no YAML, nests too deep, or holds no mapping.
    """
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError) as cause:  # ValueError: no such date
        where = getattr(cause, "problem_mark", None)
        line = f", line {where.line + 1}" if where is not None else ""
        raise error(f"{path}{line}: not valid YAML") from cause
    if not isinstance(content, dict):
        raise error(f"{path}: must hold a mapping")
    return content
