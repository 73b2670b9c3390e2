"""The versions that a run depends on: what is said of them, and how others are named."""

import platform
import re
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from msgs_config.versions import describe_changes, installed_versions, read_versions
from tests.support import engines

PROJECT = Path(__file__).parents[2]


def test_package_engines_python_and_the_c_library_say_their_versions() -> None:
    versions = installed_versions()

    assert versions["numpy"] == np.__version__
    assert versions["python"] == platform.python_version()
    assert versions["actuated_characters"] == metadata.version("actuated_characters")
    assert re.fullmatch(r"(glibc|musl|libc) \d+\.\d+\S*", versions["libc"])
    assert re.match(r"\d+\.\d+", versions["mujoco-core"])
    assert re.match(r"\d+\.\d+" if engines.BULLET_IS_INSTALLED else "unknown", versions["pybullet"])


def test_the_newest_entry_of_the_changelog_is_the_version_of_the_package() -> None:
    changelog = (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8")
    setup = (PROJECT / "setup.py").read_text(encoding="utf-8")

    newest = re.search(r"^## \[(.*?)\] - \d{4}-\d\d-\d\d$", changelog, flags=re.MULTILINE)
    version = re.search(r'version="(.*?)"', setup)

    assert newest is not None and version is not None
    assert newest[1] == version[1] == installed_versions()["actuated_characters"]


NOW = {"python": "3.12.1", "numpy": "2.4.0", "libc": "unknown"}


@pytest.mark.parametrize(
    ("recorded", "expected"),
    [
        (NOW, ""),
        ({}, ""),
        ({"numpy": "1.26.4"}, "recorded with numpy 1.26.4 (now 2.4.0)"),
        (
            {"python": "3.11.7", "numpy": "1.26.4"},
            "recorded with python 3.11.7 (now 3.12.1), numpy 1.26.4 (now 2.4.0)",
        ),
        ({"python": "unknown", "libc": "glibc 2.36", "turbo": "1"}, ""),
    ],
    ids=["same", "none", "one", "two", "unknown on one side"],
)
def test_each_version_that_is_another_one_is_named(recorded: dict[str, str], expected: str) -> None:
    assert describe_changes(recorded, NOW) == expected


@pytest.mark.parametrize(
    ("content", "expected"), [(None, {}), (1, {}), ([], {}), ({"a": 2.0}, {"a": "2.0"})]
)
def test_what_others_say_of_versions_does_no_harm(
    content: object, expected: dict[str, str]
) -> None:
    assert read_versions(content) == expected
