"""What others install: the wheel and the sdist, and what they say of themselves."""

import email
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from collections.abc import Iterable
from email.message import Message
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import setuptools
import yaml

ROOT = Path(__file__).parents[2]
PACKAGE = "actuated_characters"
FOLDERS = ("msgs_config", "sim_node", "controller_node", "character_motion", PACKAGE, "lecture")
SHARED = ("config", "examples", "launch")
ALONE = {"LICENSE", "README.md", "package.xml", "pyproject.toml", "setup.cfg", "setup.py"}
MADE = {"PKG-INFO", f"{PACKAGE}.egg-info"}
SCRIPTS = {
    "sim_node",
    "controller_node",
    "recorder",
    "viewer",
    "composed",
    "ros2_control_bridge",
    PACKAGE,
}
DESCRIPTION = ElementTree.parse(ROOT / "package.xml")
MAINTAINER = DESCRIPTION.find("maintainer")
ADDRESS = DESCRIPTION.findtext("url[@type='repository']") or ""
WRITTEN = "URL" if ".invalid/" in ADDRESS else ADDRESS  # in pages
BUILD = """
import sys
from setuptools import build_meta
print(getattr(build_meta, sys.argv[1])(sys.argv[2]))
"""


def tracked(*folders: str) -> set[str]:
    """The files of the project in these folders, those that are not committed yet among them."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *folders]
    return {
        name
        for name in subprocess.check_output(command, cwd=ROOT, text=True).splitlines()
        if (ROOT / name).is_file()
    }


def build(kind: str, sources: Path, output: Path) -> Path:
    """Build as pip does, but with the setuptools that is here."""
    command = [sys.executable, "-c", BUILD, f"build_{kind}", str(output)]
    built = subprocess.run(command, cwd=sources, check=True, capture_output=True, text=True)
    return output / built.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from the files of the project alone."""
    sources, output = tmp_path_factory.mktemp("clone"), tmp_path_factory.mktemp("sdist")
    for name in tracked():
        (sources / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, sources / name)
    return build("sdist", sources, output)


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from what the sdist has, as an installation of the sdist does."""
    if tuple(map(int, version("setuptools").split(".")[:2])) < (70, 1):
        pytest.skip("setuptools before 70.1 makes no wheels by itself; make venv brings another")
    folder = tmp_path_factory.mktemp("wheel")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    return build("wheel", next(folder.iterdir()), folder)


def metadata(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return email.message_from_bytes(archive.read(name))


def test_pages_have_the_address_of_the_description() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    commands = {
        (page.name, address)
        for page in pages
        if page.name != "documented.md"  # which is made from the others
        for address in re.findall(r"(?:git clone |git\+)([^\s\"'`]+)", page.read_text("utf-8"))
    }

    assert {name for name, _ in commands} >= {"README.md", "install.md", "ros.md"}
    assert [each for each in sorted(commands) if each[1] != WRITTEN] == []


def test_the_citation_and_the_entry_for_the_index_are_those_of_the_description() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    page = (ROOT / "docs/release.md").read_text("utf-8")
    (entry,) = re.findall(r"```yaml\n(.*?)```", page, flags=re.DOTALL)
    (repository,) = yaml.safe_load(entry).values()

    assert MAINTAINER is not None
    assert citation["authors"] == [{"name": MAINTAINER.text}]
    assert citation["version"] == DESCRIPTION.findtext("version")
    assert {repository["doc"]["url"], repository["source"]["url"]} == {ADDRESS}


def test_the_first_version_of_the_changelog_is_that_of_the_description() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    versions = re.findall(r"^## \[(.*?)\](.*)$", changelog, flags=re.MULTILINE)

    assert versions[0] == ("Unreleased", "")
    assert versions[1][0] == DESCRIPTION.findtext("version")
    assert re.fullmatch(r" - \d{4}-\d\d-\d\d", versions[1][1])


@pytest.mark.parametrize(
    "file", ["docs/ros.md", "docker/Dockerfile", ".github/workflows/jazzy.yml"]
)
def test_what_a_ros_install_takes_from_pip_is_what_the_package_requires(file: str) -> None:
    """All but what a ROS install has, and what comes with another one of them."""
    given: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr(setuptools, "setup", lambda **settings: given.update(settings))
        runpy.run_path(str(ROOT / "setup.py"))
    required = _by_name(given["install_requires"])
    known = required | _by_name(given["extras_require"]["view"])
    text = (ROOT / file).read_text("utf-8").replace("\\\n", " ")
    (words,) = re.findall(r"pip install (?:--no-cache-dir )?(colcon-.*)", text)
    taken = _by_name(shlex.split(words))

    assert required.keys() - taken.keys() <= {
        *("llvmlite", "lz4", "numpy", "pillow", "pybullet", "PyYAML"),
    }
    others = {name: each for name, each in taken.items() if each not in (name, known.get(name))}
    assert others == {"setuptools": "setuptools<80"}


def _by_name(requirements: Iterable[str]) -> dict[str, str]:
    return {re.split(r"[<>=]", each)[0]: each for each in requirements}


@pytest.mark.slow
def test_an_sdist_has_all_that_runs_and_nothing_else(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {each.name.partition("/")[2] for each in archive if each.isfile()}

    assert tracked(*FOLDERS, *SHARED) - names == set()
    assert {name.partition("/")[0] for name in names} == {
        *(*FOLDERS, *SHARED, "resource"),
        *(ALONE | MADE),
    }
    assert sdist.name == f"{PACKAGE}-{DESCRIPTION.findtext('version')}.tar.gz"


@pytest.mark.slow
def test_a_wheel_has_all_that_runs_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())

    beside = f"{PACKAGE}-{DESCRIPTION.findtext('version')}"
    share = f"{beside}.data/data/share"
    shared = {f"{share}/{PACKAGE}/{name}" for name in tracked(*SHARED)}
    index = f"{share}/ament_index/resource_index/packages/{PACKAGE}"
    assert {name for name in names if not name.startswith(f"{beside}.dist-info/")} == {
        *tracked(*FOLDERS),
        *(shared | {index, f"{share}/{PACKAGE}/package.xml"}),
    }


@pytest.mark.slow
def test_a_wheel_says_what_the_description_of_the_package_says(wheel: Path) -> None:
    said = metadata(wheel)

    assert MAINTAINER is not None
    assert said["Maintainer"] == MAINTAINER.text
    assert said["Maintainer-email"] == MAINTAINER.get("email")
    assert said["Home-page"] == ADDRESS
    assert said["Version"] == DESCRIPTION.findtext("version")
    assert {"wheels", "view"} <= set(said.get_all("Provides-Extra", ()))
    text = str(said.get_payload())
    assert text.startswith(f"# {PACKAGE}\n")
    assert re.findall(r"\]\((?!https?://)", text) == []  # an index has no pages of the clone


@pytest.mark.nightly
@pytest.mark.parametrize(("kind", "extra"), [("wheel", "[wheels]"), ("sdist", "")])
def test_an_empty_environment_installs_it_and_runs_as_the_clone_does(
    kind: str, extra: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    archive: Path = request.getfixturevalue(kind)
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("PYTHONPATH", "AMENT_PREFIX_PATH", "LD_LIBRARY_PATH")
        and not name.startswith("_ROS_WHEELS")
    }
    venv.create(tmp_path / "venv", with_pip=True)
    programs, place = tmp_path / "venv/bin", tmp_path / "empty"
    place.mkdir()

    def call(*command: str | Path) -> str:
        ran = subprocess.run(
            command, cwd=place, env=environment, capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    call(programs / "pip", "install", "-qq", f"{archive}{extra}")
    assert {path.name for path in programs.iterdir()} >= SCRIPTS
    shared = tmp_path / "venv/share" / PACKAGE
    assert [name for name in tracked(*SHARED) if not (shared / name).is_file()] == []
    call(programs / "python", "-m", "msgs_config.fetch_robots")
    run = ("run", "--clip", "walk", "--duration", "0.5", "--output")
    call(programs / PACKAGE, *run, "installed", *([] if extra else ["--in-process"]))
    clone = [sys.executable, "-c", f"from {PACKAGE}.cli import main; main()", *run]
    subprocess.run([*clone, tmp_path / "cloned", "--in-process"], cwd=ROOT, check=True)

    hashes = [
        re.findall(r'"state_hash": "(\w+)"', (folder / "summary.json").read_text("utf-8"))
        for folder in (place / "installed", tmp_path / "cloned")
    ]
    assert hashes[0] == hashes[1]
    assert hashes[0]
