"""Bodies of a few boxes that studies run, as URDF and YAML text; and the momentum of any body."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lecture.framework.study import StudyRunner
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character, Vector
from msgs_config.geometry import rotations

IN_SPACE: dict[str, object] = {"gravity": 0.0, "terrain": "none"}
"""The simulator's parameters where nothing falls, and nothing is there to fall on."""

HINGE = "hinge"
"""The joint of the body that `write_hinged_boxes` writes."""


@dataclass(frozen=True)
class Box:
    """A massive box of uniform density."""

    name: str
    mass: float  # kg
    edges: Vector  # m
    centre: Vector = (0.0, 0.0, 0.0)  # centre of mass, m in the link frame

    @property
    def inertia(self) -> FloatArray:
        """Principal moments of inertia (3,) about the centre of mass, kg m^2.

        `m (b^2 + c^2) / 12` about the axis along a.
        """
        squares = np.square(self.edges)
        moments: FloatArray = self.mass / 12.0 * (squares.sum() - squares)
        return moments

    def link(self) -> str:
        """The URDF's element; the shape is seen, and touches nothing."""
        ixx, iyy, izz = self.inertia.tolist()
        origin = f'<origin xyz="{_listed(self.centre)}"/>'
        return f"""  <link name="{self.name}">
    <inertial>
      {origin}<mass value="{self.mass!r}"/>
      <inertia ixx="{ixx!r}" ixy="0" ixz="0" iyy="{iyy!r}" iyz="0" izz="{izz!r}"/>
    </inertial>
    <visual>
      {origin}<geometry><box size="{_listed(self.edges)}"/></geometry>
    </visual>
  </link>
"""


def write_box(runner: StudyRunner, box: Box) -> str:
    """Write a box that floats; returns the character's path."""
    return _write(runner, box.name, box.link())


def write_hinged_boxes(runner: StudyRunner, name: str, parent: Box, child: Box) -> str:
    """Write two boxes that float, joined by a hinge about y at the origins of both.

    Returns the character's path.
    """
    return _write_pair(runner, name, parent, child, 'type="continuous"', '<axis xyz="0 1 0"/>')


def write_jointed_boxes(runner: StudyRunner, name: str, parent: Box, child: Box) -> str:
    """Write two boxes that float, joined by a ball joint at the origins of both.

    Returns the character's path.
    """
    return _write_pair(runner, name, parent, child, 'type="spherical"', "")


def _write_pair(
    runner: StudyRunner, name: str, parent: Box, child: Box, kind: str, axis: str
) -> str:
    joint = f"""  <joint name="{HINGE}" {kind}>
    <parent link="{parent.name}"/><child link="{child.name}"/>{axis}
  </joint>
"""
    return _write(runner, name, parent.link() + child.link() + joint)


def _write(runner: StudyRunner, name: str, elements: str) -> str:
    text = f'<?xml version="1.0"?>\n<robot name="{name}">\n{elements}</robot>\n'
    runner.path(f"{name}.urdf").write_text(text, encoding="utf-8")
    path = runner.path(f"{name}.yaml")
    path.write_text(f"urdf: {name}.urdf\ninertia: file\n", encoding="utf-8")
    return str(path)


def _listed(numbers: Sequence[float]) -> str:
    return " ".join(repr(number) for number in numbers)


@dataclass(frozen=True)
class Momenta:
    """The momentum of a body as a whole, in each of t states; world axes."""

    centre: FloatArray  # (t, 3) centre of mass, m
    linear: FloatArray  # (t, 3) kg m/s
    angular: FloatArray  # (t, 3) kg m^2/s, about the world's origin

    @property
    def spin(self) -> FloatArray:
        """Angular momentum (t, 3) about the centre of mass, kg m^2/s."""
        own: FloatArray = self.angular - np.cross(self.centre, self.linear)
        return own


def momenta(character: Character, position: FloatArray, velocity: FloatArray) -> Momenta:
    """The momentum of states (t, n) of a character, summed over its links.

    `P = sum m v` and `L = sum (c x m v + I w)`, with each link's centre of mass c and its inertia I
    in the world's axes.
    """
    model = DynamicsModel(character)
    masses = np.array([link.mass for link in character.links])
    rows = [_of_state(model, character, *state) for state in zip(position, velocity, strict=True)]
    centres, velocities, spins = (np.array(part) for part in zip(*rows, strict=True))
    momentum = masses[:, np.newaxis] * velocities
    return Momenta(
        centre=(masses[:, np.newaxis] * centres).sum(axis=1) / masses.sum(),
        linear=momentum.sum(axis=1),
        angular=(np.cross(centres, momentum) + spins).sum(axis=1),
    )


def _of_state(
    model: DynamicsModel, character: Character, position: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centre of mass, its velocity, and `I w` of each link (links, 3) in one state."""
    model.update(position, velocity)
    origins, turns = model.link_poses()
    motions = np.array([model.link_jacobian(k) @ velocity for k in range(len(origins))])
    poses = [link.inertial_pose for link in character.links]
    centres = origins + rotations.rotate(turns, np.array([pose.position for pose in poses]))
    inertial = rotations.multiply(turns, np.array([pose.orientation_xyzw for pose in poses]))
    moments = np.array([link.inertia_diagonal for link in character.links])
    own = moments * rotations.rotate(rotations.conjugate(inertial), motions[:, 3:])
    return centres, motions[:, :3], rotations.rotate(inertial, own)
