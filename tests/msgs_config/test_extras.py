"""The extras that errors and pages name are those that can be installed."""

import re
from pathlib import Path

import pytest

from msgs_config.extras import installation_of

PROJECT = Path(__file__).parents[2]
PACKAGES = ("msgs_config", "sim_node", "controller_node", "actuated_characters")
NAMED = re.compile(r"installation_of\([\"'](\w+)|(?:actuated_characters|\.)\[([\w,]+)\]'")


def offered() -> set[str]:
    """The extras of setup.py."""
    text = (PROJECT / "setup.py").read_text("utf-8")
    block = text[text.index("extras_require={") : text.index("entry_points={")]
    return set(re.findall(r'^        "(\w+)": \[', block, flags=re.MULTILINE))


def named(file: Path) -> set[str]:
    """The extras that a file names in commands of pip."""
    groups = ["".join(each) for each in NAMED.findall(file.read_text("utf-8"))]
    return {name for group in groups for name in group.split(",")}


def test_what_is_to_be_installed_can_be() -> None:
    files = [file for package in PACKAGES for file in (PROJECT / package).rglob("*.py")]
    files += [PROJECT / "README.md", *(PROJECT / "docs").glob("*.md")]
    found = {name for file in files if file.name != "extras.py" for name in named(file)}
    assert {"plan", "view", "meshes"} <= found
    assert found <= offered()


@pytest.mark.parametrize("extra", ["plan", "meshes"])
def test_the_command_is_that_of_the_docs(extra: str) -> None:
    command = installation_of(extra)
    assert f"pip install 'actuated_characters[{extra}]'" in command
    assert f".venv/bin/pip install -e '.[{extra}]'" in command
