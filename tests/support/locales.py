"""A locale with a decimal comma, compiled for the tests where the system has none."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

DECIMAL_COMMA = "de_DE.UTF-8"


def compile_decimal_comma(directory: Path) -> dict[str, str]:
    """The environment in which there is `DECIMAL_COMMA`; skips where it cannot be compiled."""
    if shutil.which("localedef") is None:
        pytest.skip("there is no localedef to compile a locale")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(directory / DECIMAL_COMMA)]
    subprocess.run(command, capture_output=True, check=False)  # it has warnings, and fails of them
    if not (directory / DECIMAL_COMMA / "LC_NUMERIC").exists():
        pytest.skip("the source of the locale de_DE is not installed")
    return {**os.environ, "LOCPATH": str(directory)}
