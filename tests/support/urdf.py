"""URDFs and character files for tests: their text, and the line that rejects a bad one."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from msgs_config.character.loading import load_character
from msgs_config.errors import CharacterError

PROJECT = Path(__file__).parents[2]
_LOAD = """
import json, resource, sys, time
from msgs_config.character.loading import load_character
from msgs_config.errors import CharacterError
for path in sys.argv[1:]:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.monotonic()
    try:
        character = load_character(path)
    except CharacterError as error:
        outcome = {"refused": str(error)}
    else:
        links = [(link.name, link.joint.name, link.parent) for link in character.links]
        outcome = {"size": character.layout.size, "links": links}
    outcome["seconds"] = time.monotonic() - start
    outcome["mebibytes"] = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    print(json.dumps(outcome), flush=True)
"""


def inertial(mass: object = 1, moment: object = 1, origin: str = "") -> str:
    """An inertia of `moment` about x and 1 kg m^2 about y and z."""
    return (
        f'<inertial>{origin}<mass value="{mass}"/><inertia ixx="{moment}" ixy="0" ixz="0" '
        'iyy="1" iyz="0" izz="1"/></inertial>'
    )


def link(name: str, inside: str | None = None) -> str:
    """A link of 1 kg, or of what is inside."""
    return f'<link name="{name}">{inertial() if inside is None else inside}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    inside: str = "",
    limit: str = '<limit lower="-1" upper="1" effort="5" velocity="9"/>',
) -> str:
    """A joint between two links."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{inside}{limit}</joint>"
    )


def robot(*parts: str) -> str:
    """A URDF of these parts."""
    return f'<robot name="robot">{"".join(parts)}</robot>'


def write_character(directory: Path, urdf: str, yaml: str = "") -> Path:
    """Write `robot.urdf` and a `robot.yaml` that names it; the latter's path."""
    (directory / "robot.urdf").write_text(urdf, encoding="utf-8")
    path = directory / "robot.yaml"
    path.write_text("urdf: robot.urdf\n" + yaml, encoding="utf-8")
    return path


def refusal(path: Path | str) -> str:
    """The one short line that rejects a character."""
    with pytest.raises(CharacterError) as caught:
        load_character(str(path))
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 1000
    return line


def load_elsewhere(*paths: Path) -> list[dict[str, Any]]:
    """What another process makes of characters: the engine can take its own process down."""
    done = subprocess.run(
        [sys.executable, "-c", _LOAD, *map(str, paths)],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    outcomes = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, (
        f"ended with {done.returncode} after {len(outcomes)} of them: {done.stderr[-500:]}"
    )
    return outcomes
