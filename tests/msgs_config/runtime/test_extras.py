"""Extras are looked for before anything begins, and the hint names them as the docs do."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from actuated_characters.cli import main
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.extras import PACKAGES, hint, require_extra

ROOT = Path(__file__).parents[3]
NEEDS = [  # package, extra, arguments
    ("viser", "view", ("run", "--character", "pendulum", "--view", "--output", "results")),
    ("websockets", "view", ("run", "--character", "pendulum", "--view", "--output", "results")),
    ("viser", "view", ("play", "--output", "results")),
    ("viser", "view", ("view",)),
    ("viser", "view", ("view", "run")),
    ("av", "video", ("render", "run", "--output", "film.mp4")),
    ("av", "video", ("render", "run", "--video")),
    ("onnx", "onnx", ("export", "walk", "--output", "walk.onnx")),
]


def test_every_extra_is_one_of_the_packaging() -> None:
    declared = set(re.findall(r'^        "(\w+)": \[', (ROOT / "setup.py").read_text(), re.M))

    assert set(PACKAGES) <= declared


def test_the_hint_is_the_one_of_the_docs() -> None:
    assert hint("view") == (
        "pip install 'actuated_characters[view]', or in a clone .venv/bin/pip install -e '.[view]'"
    )


def test_what_is_installed_is_no_error() -> None:
    require_extra("view", "a viewer")


@pytest.mark.parametrize(
    ("package", "extra", "arguments"), NEEDS, ids=lambda given: str(given).replace("/", "")
)
def test_a_command_without_its_extra_is_refused_in_one_line_before_anything_begins(
    package: str,
    extra: str,
    arguments: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed

    assert main(arguments) == 1

    output = capsys.readouterr()
    (line,) = output.err.splitlines()
    assert line.startswith("error: ")
    assert hint(extra) in line
    assert output.out == ""
    assert list(tmp_path.iterdir()) == []


def test_environments_without_gymnasium_say_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in [each for each in sys.modules if "actuated_characters.environments" in each]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)

    with pytest.raises(ConfigurationError, match=r"actuated_characters\[gymnasium\]"):
        importlib.import_module("actuated_characters.environments")


@pytest.mark.slow
def test_benchmarks_without_an_extra_end_in_one_line() -> None:
    code = (
        "import sys, runpy; sys.modules['viser'] = None; "
        "sys.argv = ['x']; "
        "runpy.run_module('benchmarks', run_name='__main__')"
    )

    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )

    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert hint("view") in done.stderr.splitlines()[-1]
