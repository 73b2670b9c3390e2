"""What several commands ask of their options before they begin."""

import os
from pathlib import Path

from msgs_config.errors import ConfigurationError

_SUFFIX = ".json"


def check_output(output: Path) -> None:
    """Raise ConfigurationError if a .json file cannot be written there."""
    if output.suffix != _SUFFIX:
        raise ConfigurationError(f"--output is {output}; it must end in {_SUFFIX}")
    if not output.absolute().parent.is_dir():
        raise ConfigurationError(f"--output is {output}; there is no directory {output.parent}")
    if output.is_dir():
        raise ConfigurationError(f"--output is {output}; it is a directory")


def worker_count(given: int | None) -> int:
    """How many processes, as many as there are cores if none are given.

    Raises:
        ConfigurationError: it is none.
    """
    count = given if given is not None else os.cpu_count() or 1
    if count < 1:
        raise ConfigurationError(f"--workers is {count}; it must be 1 or more")
    return count
