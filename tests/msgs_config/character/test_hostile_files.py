"""Files from outside are data: whatever they hold, one clear line answers, soon, in little memory.

What could take a process down is read in one of its own.
"""

from pathlib import Path
from typing import Any

import pytest

from msgs_config.character.urdf.check import MAX_JOINTS, MAX_POSITION_ENTRIES
from tests.support.urdf import (
    inertial,
    joint,
    link,
    load_elsewhere,
    refusal,
    robot,
    write_character,
)

pytestmark = pytest.mark.slow

LINK = link("a")


def assert_refused(outcome: dict[str, Any], path: Path) -> None:
    """In one line that names the file, within seconds and in a few dozen MiB."""
    assert "refused" in outcome, outcome
    assert str(path) in outcome["refused"]
    assert "\n" not in outcome["refused"]
    assert len(outcome["refused"]) < 1000
    assert outcome["seconds"] < 15.0
    assert outcome["mebibytes"] < 150.0


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
    path = write_character(tmp_path, robot(LINK), YAML[case])

    assert_refused(load_elsewhere(path), path)


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
    path = write_character(tmp_path, XML[case])

    assert_refused(load_elsewhere(path), path.with_suffix(".urdf"))


# Numbers


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "1e400", "1e31", "", "one", "1 2", "1_0"])
@pytest.mark.parametrize(
    "part",
    [
        link("a", inertial(mass="{}")),
        link("a", inertial(moment="{}")),
        link("a", inertial(origin='<origin xyz="0 0 {}"/>')),
        '<link name="a"><collision><geometry><sphere radius="{}"/></geometry></collision></link>',
        LINK + link("b") + joint("j", "a", "b", limit='<limit lower="{}" upper="1"/>'),
    ],
    ids=["mass", "moment of inertia", "origin", "radius", "limit"],
)
def test_what_is_no_finite_number_is_refused(tmp_path: Path, part: str, number: str) -> None:
    path = write_character(tmp_path, robot(part.format(number)))

    assert str(path.with_suffix(".urdf")) in refusal(path)


IMPOSSIBLE = {
    "a negative mass": link("a", inertial(mass=-1)),
    "a negative moment of inertia": link("a", inertial(moment=-1)),
    "an axis of no length": LINK
    + link("b")
    + joint("j", "a", "b", "continuous", '<axis xyz="0 0 0"/>'),
    "a joint without a name": LINK + link("b") + joint("", "a", "b", "continuous"),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_what_cannot_be_is_refused(tmp_path: Path, case: str) -> None:
    path = write_character(tmp_path, robot(IMPOSSIBLE[case]))

    assert str(path.with_suffix(".urdf")) in refusal(path)


@pytest.mark.parametrize("number", ["0", "1e-300", "1e-30", "1e20", "1e30"])
@pytest.mark.parametrize("inertia", ["file", "shapes"])
def test_extreme_numbers_do_not_take_the_engine_down(
    tmp_path: Path, number: str, inertia: str
) -> None:
    """They may be refused, or make a body that is of no use."""
    shape = f'<collision><geometry><box size="{number} 1 1"/></geometry></collision>'
    body = link("a", inertial(number, number) + shape)
    path = write_character(tmp_path, robot(body), f"inertia: {inertia}\n")

    assert {"refused", "size"} & set(load_elsewhere(path))


# Size


def chain(kind: str, count: int) -> str:
    """A robot of links one after another, on joints of one kind."""
    links = "\n".join(link(f"l{n}") for n in range(count + 1))
    joints = "\n".join(joint(f"j{n}", f"l{n}", f"l{n + 1}", kind) for n in range(count))
    return robot(links, joints)


LARGEST = [("revolute", 121, 127), ("spherical", 30, 96), ("fixed", MAX_JOINTS, 6)]


@pytest.mark.parametrize(("kind", "count", "size"), LARGEST)
def test_a_robot_as_large_as_the_engine_holds_is_taken(
    tmp_path: Path, kind: str, count: int, size: int
) -> None:
    assert load_elsewhere(write_character(tmp_path, chain(kind, count)))["size"] == size


@pytest.mark.parametrize(("kind", "count", "size"), LARGEST)
def test_a_robot_too_large_for_the_engine_is_refused(
    tmp_path: Path, kind: str, count: int, size: int
) -> None:
    """The engine itself would load it, and then read its states as empty."""
    path = write_character(tmp_path, chain(kind, count + 1))

    outcome = load_elsewhere(path)

    assert_refused(outcome, path.with_suffix(".urdf"))
    assert f"{MAX_JOINTS} and {MAX_POSITION_ENTRIES}" in outcome["refused"]


def test_a_robot_of_thousands_of_links_is_refused(tmp_path: Path) -> None:
    path = write_character(tmp_path, chain("fixed", 10_000))

    assert_refused(load_elsewhere(path), path.with_suffix(".urdf"))
