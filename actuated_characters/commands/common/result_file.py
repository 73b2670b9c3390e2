"""The file in which a long search leaves its result, which another time goes on from it."""

import os
from collections.abc import Iterable
from pathlib import Path

from msgs_config.errors import ConfigurationError


def result_file(given: Path | None, usual: Path) -> Path:
    """The file of `--output`, or the usual one, whose folder may be made.

    Raises:
        ConfigurationError: its suffix is not that of the usual one, or it cannot be written there.
    """
    output = usual if given is None else given
    if output.suffix != usual.suffix:
        raise ConfigurationError(f"--output is {output}; it must end in {usual.suffix}")
    if given is not None and not output.absolute().parent.is_dir():
        raise ConfigurationError(f"--output is {output}; there is no directory {output.parent}")
    if output.is_dir():
        raise ConfigurationError(f"--output is {output}; it is a directory")
    folder = next(each for each in output.absolute().parents if each.exists())
    if not os.access(folder, os.W_OK):
        raise ConfigurationError(f"--output is {output}; no permission to write to {folder}")
    return output


def check_not_lost(files: Iterable[Path], *, resume: bool, overwrite: bool) -> None:
    """Raise ConfigurationError if a file is there, and neither option says what becomes of it."""
    for file in files:
        if file.exists() and not (resume or overwrite):
            raise ConfigurationError(f"{file} exists; --resume goes on, --overwrite starts over")
