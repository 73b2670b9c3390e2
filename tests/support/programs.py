"""Short programs that a test runs in a process of their own, for what is a whole process'."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

PROJECT = Path(__file__).parents[2]


def run_program(
    code: str, *arguments: str, environment: Mapping[str, str] | None = None, timeout: float = 120.0
) -> subprocess.CompletedProcess[str]:
    """Run Python code to its end; whether it ended well is left to the caller."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=PROJECT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def output_of(code: str, *arguments: str, environment: Mapping[str, str] | None = None) -> str:
    """What Python code prints, which ends well and complains of nothing."""
    ended = run_program(code, *arguments, environment=environment)
    assert (ended.returncode, ended.stderr) == (0, "")
    return ended.stdout
