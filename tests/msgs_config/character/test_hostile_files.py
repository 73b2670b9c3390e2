"""Files from outside are data: whatever they hold, one clear line answers, soon, in little memory.

What could take a process down is read in one of its own.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msgs_config.character.loading import load_character
from msgs_config.character.urdf_check import MAX_JOINTS, MAX_POSITION_ENTRIES
from msgs_config.errors import CharacterError

pytestmark = pytest.mark.slow

PROJECT = Path(__file__).parents[3]
READ = """
import json, resource, sys, time
from msgs_config.character.loading import load_character
from msgs_config.errors import CharacterError
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.monotonic()
try:
    character = load_character(sys.argv[1])
except CharacterError as error:
    outcome = {"refused": str(error)}
else:
    outcome = {"size": character.layout.size}
outcome["seconds"] = time.monotonic() - start
outcome["mebibytes"] = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
print(json.dumps(outcome))
"""


def read(path: Path) -> dict[str, Any]:
    """What another process makes of a character."""
    done = subprocess.run(
        [sys.executable, "-c", READ, str(path)],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, f"ended with {done.returncode}: {done.stderr[-500:]}"
    outcome: dict[str, Any] = json.loads(done.stdout)
    return outcome


def write(directory: Path, urdf: str, yaml: str = "") -> Path:
    (directory / "robot.urdf").write_text(urdf)
    (directory / "robot.yaml").write_text("urdf: robot.urdf\n" + yaml)
    return directory / "robot.yaml"


def assert_refused(outcome: dict[str, Any], path: Path) -> None:
    """In one line that names the file, within seconds and in a few dozen MiB."""
    assert "refused" in outcome, outcome
    assert_clear(outcome["refused"], path)
    assert outcome["seconds"] < 15.0
    assert outcome["mebibytes"] < 150.0


def assert_clear(line: str, path: Path) -> None:
    assert str(path) in line
    assert "\n" not in line
    assert len(line) < 1000


def inertial(mass: str = "1", moment: str = "1", origin: str = "") -> str:
    return (
        f'<inertial>{origin}<mass value="{mass}"/><inertia ixx="{moment}" ixy="0" ixz="0" '
        f'iyy="1" iyz="0" izz="1"/></inertial>'
    )


LINK = f'<link name="a">{inertial()}</link>'


def robot(*parts: str) -> str:
    return f'<robot name="robot">{"".join(parts)}</robot>'


# YAML

LEVELS = 9
TEN_OF_EACH = [", ".join([f"*l{level - 1}"] * 10) for level in range(1, LEVELS)]
YAML = {
    "thousands of lists": "scale: " + "[" * 50_000,
    "thousands of mappings": "scale: " + "{a: " * 20_000,
    "hundreds of blocks": "scale:\n" + "".join(" " * n + "-\n" for n in range(300)),
    "lists that stand for a thousand million": "l0: &l0 [0]\n"
    + "".join(f"l{n}: &l{n} [{ten}]\n" for n, ten in enumerate(TEN_OF_EACH, start=1)),
    "mappings that merge into a thousand million": "l0: &l0 {a: 0}\n"
    + "".join(f"l{n}: &l{n} {{<<: [{ten}]}}\n" for n, ten in enumerate(TEN_OF_EACH, start=1)),
    "a list too long": "scale: [" + "0," * 100_000 + "]",
    "a number of too many digits": "scale: 0x" + "f" * 100_000,
    "a number of too many parts": "scale: 1" + ":59" * 30_000,
    "a text too long": 'scale: "' + "a" * 100_000 + '"',
    "a key too long": f'? "{"a" * 100_000}"\n: 1',
}


@pytest.mark.parametrize("case", YAML)
def test_hostile_yaml_is_refused(tmp_path: Path, case: str) -> None:
    path = write(tmp_path, robot(LINK), YAML[case])

    assert_refused(read(path), path)


# XML

ENTITIES = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 10))
BILLION_LAUGHS = f'<!DOCTYPE robot [<!ENTITY e0 "aaaaaaaaaa">{ENTITIES}]>'
XML = {
    "a billion laughs": BILLION_LAUGHS + robot('<link name="&e9;"/>'),
    "a billion laughs in a text": BILLION_LAUGHS + robot(LINK, "&e9;"),
    "a file of the system": '<!DOCTYPE robot [<!ENTITY f SYSTEM "file:///etc/passwd">]>'
    + robot('<link name="&f;"/>'),
    "an outer document type": '<!DOCTYPE robot SYSTEM "http://127.0.0.1:9/x.dtd">' + robot(LINK),
    "an entity that does not exist": robot('<link name="&f;"/>'),
    "an end that never comes": "<robot>" * 100_000,
    "thousands of levels": robot(LINK, "<a>" * 50_000 + "</a>" * 50_000),
    "a million elements": robot(LINK, "<a/>" * 1_000_000),
    "a text too long": robot(LINK, "a" * 1_000_000),
    "a name too long": robot('<link name="' + "a" * 100_000 + '"/>'),
    "the robot's name too long": f'<robot name="{"a" * 100_000}">{LINK}</robot>',
    "a name of two lines": robot('<link name="a&#10;b"/>'),
    "a link without a name": robot("<link/>"),
}


@pytest.mark.parametrize("case", XML)
def test_hostile_xml_is_refused(tmp_path: Path, case: str) -> None:
    path = write(tmp_path, XML[case])

    assert_refused(read(path), path.with_suffix(".urdf"))


# Numbers


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "1e400", "1e31", "", "one", "1 2", "1_0"])
@pytest.mark.parametrize(
    "part",
    [
        '<link name="a">' + inertial(mass="{}") + "</link>",
        '<link name="a">' + inertial(moment="{}") + "</link>",
        '<link name="a">' + inertial(origin='<origin xyz="0 0 {}"/>') + "</link>",
        '<link name="a"><collision><geometry><sphere radius="{}"/></geometry></collision></link>',
        LINK + '<link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/><limit lower="{}" upper="1"/></joint>',
    ],
    ids=["mass", "moment of inertia", "origin", "radius", "limit"],
)
def test_what_is_no_finite_number_is_refused(tmp_path: Path, part: str, number: str) -> None:
    path = write(tmp_path, robot(part.format(number)))

    with pytest.raises(CharacterError) as caught:
        load_character(str(path))

    assert_clear(str(caught.value), path.with_suffix(".urdf"))


IMPOSSIBLE = {
    "a negative mass": '<link name="a">' + inertial(mass="-1") + "</link>",
    "a negative moment of inertia": '<link name="a">' + inertial(moment="-1") + "</link>",
    "an axis of no length": LINK + '<link name="b"/><joint name="j" type="continuous">'
    '<parent link="a"/><child link="b"/><axis xyz="0 0 0"/></joint>',
    "a joint without a name": LINK + '<link name="b"/><joint type="continuous">'
    '<parent link="a"/><child link="b"/></joint>',
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_what_cannot_be_is_refused(tmp_path: Path, case: str) -> None:
    path = write(tmp_path, robot(IMPOSSIBLE[case]))

    with pytest.raises(CharacterError) as caught:
        load_character(str(path))

    assert_clear(str(caught.value), path.with_suffix(".urdf"))


@pytest.mark.parametrize("number", ["0", "1e-300", "1e-30", "1e20", "1e30"])
@pytest.mark.parametrize("inertia", ["file", "shapes"])
def test_extreme_numbers_do_not_take_the_engine_down(
    tmp_path: Path, number: str, inertia: str
) -> None:
    """They may be refused, or make a body that is of no use."""
    shape = f'<collision><geometry><box size="{number} 1 1"/></geometry></collision>'
    link = f'<link name="a">{inertial(mass=number, moment=number)}{shape}</link>'
    path = write(tmp_path, robot(link), f"inertia: {inertia}\n")

    assert {"refused", "size"} & set(read(path))


# Size


def chain(kind: str, count: int) -> str:
    """A robot of links one after another, on joints of one kind."""
    links = "".join(f'<link name="l{n}">{inertial()}</link>\n' for n in range(count + 1))
    joints = "".join(
        f'<joint name="j{n}" type="{kind}"><parent link="l{n}"/><child link="l{n + 1}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>\n'
        for n in range(count)
    )
    return robot(links, joints)


LARGEST = [("revolute", 121, 127), ("spherical", 30, 96), ("fixed", MAX_JOINTS, 6)]


@pytest.mark.parametrize(("kind", "count", "size"), LARGEST)
def test_a_robot_as_large_as_the_engine_holds_is_taken(
    tmp_path: Path, kind: str, count: int, size: int
) -> None:
    assert read(write(tmp_path, chain(kind, count)))["size"] == size


@pytest.mark.parametrize(("kind", "count", "size"), LARGEST)
def test_a_robot_too_large_for_the_engine_is_refused(
    tmp_path: Path, kind: str, count: int, size: int
) -> None:
    """The engine itself would load it, and then read its states as empty."""
    path = write(tmp_path, chain(kind, count + 1))

    outcome = read(path)

    assert_refused(outcome, path.with_suffix(".urdf"))
    assert f"{MAX_JOINTS} and {MAX_POSITION_ENTRIES}" in outcome["refused"]


def test_a_robot_of_thousands_of_links_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, chain("fixed", 10_000))

    assert_refused(read(path), path.with_suffix(".urdf"))
