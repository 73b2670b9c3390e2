"""A URDF's links and joints are Bullet's own, each number to the last bit.

Bullet reads the repaired text by itself. The URDFs are those that PyBullet ships, the project's own
and some that are drawn at random: turned frames, several shapes a link, meshes scaled and mirrored.
"""

import math
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet_data
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.file import read_character_file
from msgs_config.character.layout import SCALAR, JointType
from msgs_config.character.links.reading import read_links
from msgs_config.character.meshes.resolving import resolve_meshes
from msgs_config.character.model import Link, UrdfOptions
from msgs_config.character.shapes import read_shapes
from msgs_config.character.urdf.repair import repair_urdf
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from tests.support.engines import Engine, load_urdf, pybullet
from tests.support.urdf import joint, robot

PROJECT = Path(__file__).parents[4]
DATA = Path(pybullet_data.getDataPath())
TYPES = {
    pybullet.JOINT_REVOLUTE: JointType.REVOLUTE,
    pybullet.JOINT_PRISMATIC: JointType.PRISMATIC,
    pybullet.JOINT_SPHERICAL: JointType.SPHERICAL,
    pybullet.JOINT_FIXED: JointType.FIXED,
}


class Numbers(NamedTuple):
    """What counts of a link and of the joint that it hangs on."""

    name: str
    parent: int
    mass: float
    moments: tuple[float, ...]
    centre: tuple[float, ...]
    principal_axes_xyzw: tuple[float, ...]
    joint: tuple[Any, ...]


def ours(link: Link) -> Numbers:
    joint, pose = link.joint, link.joint.pose_in_parent
    own = (
        *(joint.name, joint.type, joint.axis_in_child, pose.position, pose.orientation_xyzw),
        *(joint.lower, joint.upper, joint.effort_limit, joint.damping, joint.friction),
    )
    inertial = link.inertial_pose
    return Numbers(
        *(link.name, link.parent, link.mass, link.inertia_diagonal),
        *(inertial.position, inertial.orientation_xyzw),
        () if link.parent < 0 else own,
    )


def bullets(loading: UrdfOptions) -> list[Numbers]:
    """The same from Bullet, with its joints' frames turned from the inertial ones to the links'."""
    client = Engine()
    try:
        body = load_urdf(client, loading)
        names = [pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()]
        links = [Numbers(names[0], -1, *dynamics_of(client, body, -1), ())]
        for number in range(pybullet.getNumJoints(body, physicsClientId=client)):
            info = pybullet.getJointInfo(body, number, physicsClientId=client)
            parent, dynamics = info[16] + 1, dynamics_of(client, body, number)
            joint = joint_of(info, links[parent], np.array(dynamics[3]))
            links.append(Numbers(info[12].decode(), parent, *dynamics, joint))
    finally:
        client.close()
    return links


def dynamics_of(client: Any, body: int, number: int) -> tuple[Any, ...]:
    mass, _, *rest = pybullet.getDynamicsInfo(body, number, physicsClientId=client)[:5]
    return (mass, *rest)


def joint_of(info: tuple[Any, ...], parent: Numbers, child_turn: FloatArray) -> tuple[Any, ...]:
    """Position, turn and axis are given in the parent's and the child's inertial frame."""
    parent_turn = np.array(parent.principal_axes_xyzw)
    offset, turn, axis = (np.array(info[index], dtype=float) for index in (14, 15, 13))
    position = np.array(parent.centre) + rotations.rotate(parent_turn, offset)
    half = rotations.multiply(parent_turn, rotations.conjugate(turn))
    orientation = rotations.multiply(half, rotations.conjugate(child_turn))
    kind = TYPES[info[2]]
    lower, upper, effort, damping, friction = (info[index] for index in (8, 9, 10, 6, 7))
    limited, is_scalar = kind in SCALAR and lower <= upper, kind in SCALAR
    return (
        *(info[1].decode(), kind, tuple(rotations.rotate(child_turn, axis).tolist())),
        *(tuple(position.tolist()), tuple(orientation.tolist())),
        *((lower, upper) if limited else (-math.inf, math.inf)),
        effort if effort > 0.0 else math.inf,
        *((damping, friction) if is_scalar else (0.0, 0.0)),
    )


def assert_bullets(directory: Path, urdf: Path, scales: tuple[float, ...] = (1.0, 0.3)) -> int:
    """Compare a URDF's links, read in all ways; returns how many were."""
    path, count = directory / "robot.yaml", 0
    for inertia in ("file", "shapes", "filled"):
        for scale in scales:
            path.write_text(f"urdf: {urdf}\ninertia: {inertia}\nscale: {scale}\n")
            try:
                file = read_character_file(str(path)).loading
                repaired = resolve_meshes(file).robot
                repair_urdf(repaired, file)
                read_shapes(repaired, file)
            except CharacterError:
                continue  # refused before it is read, as one of cloth is
            for loading in (file, replace(file, fixed_base=not file.fixed_base)):
                repaired = resolve_meshes(loading).robot
                repair_urdf(repaired, loading)
                links = [ours(link) for link in read_links(repaired, loading)]
                # as texts, so that a zero has its sign
                assert list(map(repr, links)) == list(map(repr, bullets(loading)))
                count += 1
    return count


def few(files: Iterator[Path]) -> list[Path]:
    """All but most of a thousand bodies of one kind."""
    return [f for f in files if "random_urdfs" not in f.parts or f.stem in ("000", "500")]


SHIPPED = few(DATA.rglob("*.urdf"))
OWN = [*(PROJECT / "tests/data").glob("*.urdf"), *(PROJECT / "msgs_config").rglob("*.urdf")]


@pytest.mark.slow
@pytest.mark.parametrize(
    "part", [2, *(pytest.param(part, marks=pytest.mark.nightly) for part in (0, 1, 3))]
)
def test_robots_that_pybullet_ships_are_bullets(tmp_path: Path, part: int) -> None:
    assert sum(assert_bullets(tmp_path, urdf) for urdf in sorted(SHIPPED)[part::4]) > 100


def test_the_projects_own_robots_are_bullets(tmp_path: Path) -> None:
    assert sum(assert_bullets(tmp_path, urdf) for urdf in OWN) >= 6 * len(OWN)


# Random robots

GROUPS = """\
vn 0 0 1
vt 0 0
o one
v 0 0 0
v 1.1 0 0
v 0 1.3 0
v 9 9 9
f 1 2 3
g two, and its name
v 0.123456789 -2 3
f -1/1 -5//1 3 2
o three
f 4 3 1
"""
ROUND_ANGLES = ("0", "-0", "1.5707963", "-1.57079632679", "3.14159265", "3.141592653589793")


class Dice:
    """Parts of URDFs, drawn at random."""

    def __init__(self, seed: int, meshes: list[Path]) -> None:
        self._random, self._meshes = random.Random(seed), meshes

    def numbers(self, count: int = 3) -> str:
        kinds = (
            lambda: self._random.choice(ROUND_ANGLES),
            lambda: repr(self._random.uniform(-3.0, 3.0)),
            lambda: f"{self._random.uniform(-1e-3, 1e-3):.2e}",
        )
        return " ".join(self._random.choice(kinds)() for _ in range(count))

    def lengths(self, count: int = 1) -> str:
        return " ".join(
            self._random.choice(("0.1", "1", "0.002", repr(self._random.uniform(1e-3, 2.0))))
            for _ in range(count)
        )

    def origin(self) -> str:
        return self._random.choice(
            (
                "",
                "<origin/>",
                f'<origin xyz="{self.numbers()}"/>',
                f'<origin rpy="{self.numbers()}"/>',
                f'<origin xyz="{self.numbers()}" rpy="{self.numbers()}"/>',
            )
        )

    def collision(self) -> str:
        mesh = self._random.choice(self._meshes)
        scale = self._random.choice(("1 1 1", self.lengths(3), "-1 1 -0.3"))
        shape = self._random.choice(
            (
                f'<sphere radius="{self.lengths()}"/>',
                f'<box size="{self.lengths(3)}"/>',
                f'<cylinder radius="{self.lengths()}" length="{self.lengths()}"/>',
                f'<capsule radius="{self.lengths()}" length="{self.lengths()}"/>',
                f'<mesh filename="{mesh}" scale="{scale}"/>',
            )
        )
        concave = self._random.choice(("", "", ' concave="yes"'))
        return f"<collision{concave}>{self.origin()}<geometry>{shape}</geometry></collision>"

    def link(self, name: str) -> str:
        x, y = sorted(self._random.uniform(0.01, 1.0) for _ in range(2))
        z = self._random.uniform(y - x, x + y)
        products = [self._random.choice((0.0, self._random.uniform(-0.01, 0.01))) for _ in "xyz"]
        inertial = (
            f'<inertial>{self.origin()}<mass value="{self._random.choice((0, self.lengths()))}"/>'
            f'<inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="{products[0]}" ixz="{products[1]}" '
            f'iyz="{products[2]}"/></inertial>'
        )
        shapes = "".join(self.collision() for _ in range(self._random.choice((0, 1, 1, 1, 3))))
        contact = self._random.choice(("", "", '<contact><inertia_scaling value="2.5"/></contact>'))
        return f'<link name="{name}">{inertial}{shapes}{contact}</link>'

    def joint(self, number: int) -> str:
        kinds = ("revolute", "continuous", "prismatic", "spherical", "fixed")
        axis = self._random.choice(
            (
                "",
                '<axis xyz="0 -1 0"/>',
                '<axis xyz="1 2 3"/>',
                f'<axis xyz="1 {self.numbers(2)}"/>',
            )
        )
        dynamics = self._random.choice(("", '<dynamics friction="0.2"/>'))
        lower = self._random.uniform(-2.0, 0.0)
        return joint(
            f"j{number}",
            f"l{self._random.randrange(number)}",
            f"l{number}",
            self._random.choice(kinds),
            self.origin() + axis + dynamics,
            f'<limit lower="{lower}" upper="{lower + 0.7}" '
            f'effort="{self._random.choice((0, 7.3))}"/>',
        )

    def robot(self) -> str:
        count = self._random.randrange(1, 6)
        joints = [self.joint(number) for number in range(1, count)]
        self._random.shuffle(joints)
        return robot(*(self.link(f"l{number}") for number in range(count)), *joints)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_random_robots_are_bullets(tmp_path: Path, seed: int) -> None:
    groups, ends = tmp_path / "groups.obj", tmp_path / "ends.obj"
    groups.write_text(GROUPS)
    ends.write_bytes(GROUPS.replace("\n", "\r\n").encode())
    shipped = ("cube.obj", "domino/domino.obj", "a1/meshes/hip.obj", "kuka_iiwa/meshes/link_1.stl")
    dice = Dice(seed, [groups, ends, *(DATA / name for name in shipped)])
    urdf = tmp_path / "random.urdf"

    for _ in range(8):
        urdf.write_text(dice.robot())
        assert assert_bullets(tmp_path, urdf) == 12, urdf.read_text()
