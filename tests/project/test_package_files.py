"""What an installed package has beside its modules: all that its modules read."""

import runpy
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import setuptools

ROOT = Path(__file__).resolve().parents[2]


def test_scripts_styles_and_data_beside_modules_are_packaged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **settings: given.update(settings))
    monkeypatch.chdir(ROOT)
    runpy.run_path(str(ROOT / "setup.py"))
    patterns: Mapping[str, list[str]] = given["package_data"]
    packaged = {
        path.relative_to(ROOT)
        for package, each in patterns.items()
        for pattern in each
        for path in (ROOT.glob(f"**/{pattern}") if not package else (ROOT / package).glob(pattern))
    }

    folders = sorted({name.partition(".")[0] for name in given["packages"]})
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *folders]
    files = map(Path, subprocess.check_output(command, text=True).splitlines())
    beside = {file for file in files if file.suffix != ".py"}

    assert sorted(beside - packaged) == []
