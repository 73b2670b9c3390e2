"""Files from outside are data: whatever they hold, one clear line answers, soon, in little memory.

What could take a process down is read in one of its own, a family after the other.
"""

from collections.abc import Mapping
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


def load_family(directory: Path, cases: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    """The path and the outcome of each case, of a URDF and the rest of a character's file."""
    paths = {}
    for number, (name, texts) in enumerate(cases.items()):
        (folder := directory / str(number)).mkdir()
        paths[name] = write_character(folder, *texts)
    outcomes = load_elsewhere(*paths.values())
    return {name: (paths[name], each) for name, each in zip(paths, outcomes, strict=True)}


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


def test_hostile_yaml_is_refused(tmp_path: Path) -> None:
    found = load_family(tmp_path, {name: (robot(LINK), text) for name, text in YAML.items()})

    for path, outcome in found.values():
        assert_refused(outcome, path)


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


def test_hostile_xml_is_refused(tmp_path: Path) -> None:
    found = load_family(tmp_path, {name: (text, "") for name, text in XML.items()})

    for path, outcome in found.values():
        assert_refused(outcome, path.with_suffix(".urdf"))


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


def test_extreme_numbers_do_not_take_the_engine_down(tmp_path: Path) -> None:
    """They may be refused, or make a body that is of no use."""
    cases = {}
    for number in ("0", "1e-300", "1e-30", "1e20", "1e30"):
        shape = f'<collision><geometry><box size="{number} 1 1"/></geometry></collision>'
        body = robot(link("a", inertial(number, number) + shape))
        for inertia in ("file", "shapes"):
            cases[f"{number} {inertia}"] = (body, f"inertia: {inertia}\n")

    for name, (_, outcome) in load_family(tmp_path, cases).items():
        assert {"refused", "size"} & set(outcome), name


# Size


def chain(kind: str, count: int) -> str:
    """A robot of links one after another, on joints of one kind."""
    links = "\n".join(link(f"l{n}") for n in range(count + 1))
    joints = "\n".join(joint(f"j{n}", f"l{n}", f"l{n + 1}", kind) for n in range(count))
    return robot(links, joints)


LARGEST = [("revolute", 121, 127), ("spherical", 30, 96), ("fixed", MAX_JOINTS, 6)]


def test_a_robot_as_large_as_the_engine_holds_is_taken_and_a_larger_one_refused(
    tmp_path: Path,
) -> None:
    """The engine itself would load the larger one, and then read its states as empty."""
    largest = {kind: (chain(kind, count), "") for kind, count, _ in LARGEST}
    larger = {f"more {kind}": (chain(kind, count + 1), "") for kind, count, _ in LARGEST}
    larger["more of thousands"] = (chain("fixed", 10_000), "")

    found = load_family(tmp_path, largest | larger)

    for kind, _, size in LARGEST:
        assert found[kind][1]["size"] == size, kind
        assert f"{MAX_JOINTS} and {MAX_POSITION_ENTRIES}" in found[f"more {kind}"][1]["refused"]
    for kind in larger:
        path, outcome = found[kind]
        assert_refused(outcome, path.with_suffix(".urdf"))
