"""The files that the sub-commands of `motion` take and make: single ones, or whole folders."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from msgs_config.errors import ConfigurationError, RecordingError


@dataclass(frozen=True)
class Conversion:
    """A file, and the one that is made of it."""

    source: str  # a path, or a clip's name
    output: Path


def find_files(folder: Path, suffixes: Sequence[str]) -> list[Path]:
    """The files of a folder and of those in it that end in one of some suffixes, in order.

    Notes beside clips, such as a licence in a .txt file, are left out.

    Raises:
        ConfigurationError: there is none.
    """
    from msgs_config.clips.reading import is_note

    found = (p for p in folder.rglob("*") if p.suffix.lower() in suffixes and p.is_file())
    files = sorted(p for p in found if not is_note(p))
    if not files:
        wanted = " or ".join(suffixes)
        raise ConfigurationError(f"{folder}: there is no {wanted} file of motion in it")
    return files


def plan_conversions(
    source: str,
    output: Path | None,
    suffixes: Sequence[str],
    suffix: str,
    *,
    beside: str,
    overwrite: bool,
) -> list[Conversion]:
    """What is to be made of a source, which may be a folder: one file for each of its own.

    Args:
        source: A file, a clip's name, or a folder.
        output: A file, or a folder for those of a folder; None is a name of its own.
        suffixes: Of the files of a folder that count.
        suffix: Of the files that are made.
        beside: Added to the name of the source where there is no output.
        overwrite: Whether files may be replaced.

    Raises:
        ConfigurationError: there is nothing to convert, or the output does not fit.
        RecordingError: a file exists already, or cannot be written.
    """
    path = Path(source)
    if path.is_dir():
        whole = path.resolve()
        folder = output or whole.with_name(whole.name + (beside or "-clips"))
        conversions = _conversions_of(path, folder, suffixes, suffix)
    else:
        file = output or Path(path.stem + beside + suffix)
        if file.suffix != suffix:
            raise ConfigurationError(f"--output {file}: it must end in {suffix}")
        conversions = [Conversion(source, file)]
    for each in conversions:
        if each.output.is_dir():
            raise RecordingError(f"cannot write {each.output}: it is a directory")
        if each.output.exists() and not overwrite:
            raise RecordingError(f"{each.output} exists already; --overwrite replaces it")
    return conversions


def _conversions_of(
    source: Path, output: Path, suffixes: Sequence[str], suffix: str
) -> list[Conversion]:
    """Those of a folder's files, into another folder. Raises ConfigurationError."""
    if output.exists() and not output.is_dir():
        raise ConfigurationError(f"--output {output}: it must be a folder, as {source} is one")
    conversions = [
        Conversion(str(each), output / each.relative_to(source).with_suffix(suffix))
        for each in find_files(source, suffixes)
    ]
    if len({each.output for each in conversions}) < len(conversions):
        raise ConfigurationError(f"{source}: two files differ in their suffix alone")
    return conversions


def make_folder_of(file: Path) -> None:
    """Make the folder of a file. Raises RecordingError if that fails."""
    try:
        file.absolute().parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write {file}: {error.strerror or error}") from error
