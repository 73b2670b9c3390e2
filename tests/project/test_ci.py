"""`.ci/run` installs a browser where it can, and runs the tests in any case."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.browser import NO_CHROMIUM

PROJECT = Path(__file__).parents[2]
BROWSER_TESTS = "tests/actuated_characters/viewer/test_browser.py"
TOOLS = ("bash", "cat", "dirname", "grep", "timeout")
STUB = '#!/usr/bin/env bash\necho "{name} $*" >>"{log}"\n{does}\n'
IS_DEBIAN = Path("/etc/os-release").is_file() and "\nID=debian\n" in Path(
    "/etc/os-release"
).read_text(encoding="utf-8")


def run_ci(folder: Path, user: int, apt: str, *, has_chromium: bool = False) -> tuple[str, str]:
    """Run it with stubs of what alters a machine; its output, and the calls of the stubs."""
    log, tools = folder / "calls", folder / "bin"
    tools.mkdir()
    for tool in TOOLS:
        found = shutil.which(tool)
        assert found
        (tools / tool).symlink_to(found)
    stubs = {"apt-get": apt, "make": "", "id": f"echo {user}"}
    for name, does in stubs.items() | ({"chromium": ""}.items() if has_chromium else set()):
        stub = tools / name
        stub.write_text(STUB.format(name=name, log=log, does=does))
        stub.chmod(0o755)
    run = subprocess.run(
        [PROJECT / ".ci" / "run"],
        env={"PATH": str(tools)},
        capture_output=True,
        text=True,
        timeout=60.0,
        check=True,
    )
    assert run.stderr == ""
    return run.stdout, log.read_text()


@pytest.mark.skipif(not IS_DEBIAN, reason="not on Debian")
def test_root_on_debian_gets_a_browser_from_debians_packages(tmp_path: Path) -> None:
    output, calls = run_ci(tmp_path, 0, "exit 0")

    assert output == ""
    assert [line for line in calls.splitlines() if line.endswith(" chromium")]
    assert calls.splitlines()[-1] == "make test"


@pytest.mark.parametrize(("user", "apt"), [(0, "echo Err: no network >&2; exit 100"), (1000, "")])
def test_without_a_browser_the_tests_run_and_a_line_says_so(
    tmp_path: Path, user: int, apt: str
) -> None:
    output, calls = run_ci(tmp_path, user, apt)

    assert output.splitlines() == [
        "no chromium, and none could be installed: the tests in a browser do not run"
    ]
    assert ("apt-get" in calls) == (user == 0 and IS_DEBIAN)
    assert calls.splitlines()[-1] == "make test"


def test_a_browser_that_is_there_is_used(tmp_path: Path) -> None:
    output, calls = run_ci(tmp_path, 0, "exit 1", has_chromium=True)

    assert (output, calls) == ("", "make test\n")


@pytest.mark.slow
def test_the_summary_names_the_tests_in_a_browser_that_did_not_run(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-m", "", "-p", "no:cacheprovider", BROWSER_TESTS],
        env={**os.environ, "PATH": str(tmp_path)},
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=True,
    )

    summary = run.stdout[run.stdout.index(f"tests in a browser {NO_CHROMIUM}") :]
    written = (PROJECT / BROWSER_TESTS).read_text(encoding="utf-8").split("\ndef test_")[1:]
    assert written
    for test in written:
        assert f"{BROWSER_TESTS}::test_{test.partition('(')[0]}" in summary
