"""What a state machine sees of its character in a state, world axes."""

from dataclasses import dataclass

from controller_node.behaviours.state_machine.legs.leg import Leg
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import fixed_order
from msgs_config.geometry.scalars import (
    Quaternion,
    Vector,
    about_z,
    add,
    conjugate,
    multiply,
    rotate,
    yaw,
)


@dataclass(frozen=True)
class Foot:
    """A foot in a state."""

    sole: Vector  # m, the middle
    velocity: Vector  # m/s, of the foot's centre of mass
    turn: Quaternion  # against how it stands, facing along x
    load: float  # N, of what touches it, upwards


@dataclass(frozen=True, eq=False)
class BodyState:
    """A state, and what the model makes of it."""

    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    root: Vector  # m
    root_xyzw: Quaternion
    tilt: Quaternion  # how the root is turned against standing, facing along x
    centre: Vector  # centre of mass, m
    centre_velocity: Vector  # m/s
    turns: list[Quaternion]  # orientation of each link
    spin: Vector  # rad/s, of the root
    feet: dict[str, Foot]  # by side

    @property
    def heading(self) -> float:
        """The way that the root faces, rad about z from x."""
        return yaw(self.tilt)


class BodyReader:
    """Makes a `Body` of each state."""

    def __init__(self, model: DynamicsModel, legs: dict[str, Leg], upright: Quaternion) -> None:
        """`upright` is the orientation of the root of a character that stands and faces along x."""
        self._model, self._legs = model, legs
        self._from_upright = conjugate(upright)

    def read(self, position: FloatArray, velocity: FloatArray, contacts: FloatArray) -> BodyState:
        """The body in a state, in which the model then is; `contacts` (links, 6) as observed."""
        self._model.update(position, velocity)
        origins, turns = self._model.link_poses()
        feet = {
            side: _foot(
                leg,
                (origins[leg.foot_link], turns[leg.foot_link]),
                fixed_order.apply(self._model.link_jacobian(leg.foot_link)[:3], velocity),
                contacts,
            )
            for side, leg in self._legs.items()
        }
        quaternions: list[Quaternion] = [(x, y, z, w) for x, y, z, w in turns.tolist()]
        root_xyzw = quaternions[0]
        return BodyState(
            position=position,
            velocity=velocity,
            root=vector(position[:3]),
            root_xyzw=root_xyzw,
            tilt=multiply(root_xyzw, self._from_upright),
            centre=vector(self._model.centre_of_mass()),
            centre_velocity=vector(self._model.centre_of_mass_velocity()),
            turns=quaternions,
            spin=rotate(root_xyzw, vector(velocity[3:6])),
            feet=feet,
        )


def _foot(
    leg: Leg, frame: tuple[FloatArray, FloatArray], velocity: FloatArray, contacts: FloatArray
) -> Foot:
    """A foot whose link has a frame (origin, orientation) and a velocity in the world."""
    origin, turn = frame
    x, y, z, w = turn.tolist()
    sole = add(vector(origin), rotate((x, y, z, w), leg.sole_in_foot))
    against = multiply((x, y, z, w), conjugate(leg.upright[2]))
    return Foot(sole, vector(velocity), against, float(contacts[leg.foot_link, 2]))


def vector(values: FloatArray) -> Vector:
    """An array (3,) as single numbers."""
    x, y, z = values.tolist()
    return (x, y, z)


def in_frame(heading: float, vector: Vector) -> Vector:
    """A vector of the world in axes ahead, to the left and up of a heading in rad."""
    return rotate(about_z(-heading), vector)


def in_world(heading: float, vector: Vector) -> Vector:
    """A vector in axes ahead, to the left and up of a heading in rad, in the world."""
    return rotate(about_z(heading), vector)
