"""Balance on two feet by joint efforts alone, which exert ground wrenches by the Jacobians.

A virtual force draws the centre of mass over the middle of the feet. Only the ground can exert it,
on the soles: each foot gets its part w, and the joints the efforts that press it so against the
ground, `-J^T w`. A sole bears no more than its edges allow; what is missing bends the body.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character, ShapeType
from msgs_config.errors import CharacterError, one_of
from msgs_config.geometry import fixed_order, rotations
from msgs_config.settings import Settings, parameter

_ROOT_ENTRIES = 6  # entries of the floating base, the first ones
_LEAST_LOAD = 1.0  # N, the least load on both feet, where the law would have them pull
_MOST_LOAD = 2.0  # weights, the largest load on both feet
_FULL_FOOTING, _NO_FOOTING = 0.75, 0.5  # cosines of a sole's tilt: 41 and 60 degrees
_LEAST_TIPPING = 1e-9  # N m^2, the least divisor, where the feet are in one place


class BalanceGains(Settings, prefix="balance."):
    """How the centre of mass is held. The defaults suit the humanoid, 45 kg."""

    stiffness: float = parameter(
        1000.0,
        "horizontally, of the centre of mass to the middle of the feet",
        unit="N/m",
        live=True,
    )
    damping: float = parameter(600.0, "of the centre of mass", unit="N s/m", live=True)
    friction: float = parameter(
        0.3, "largest horizontal force on the feet, as a share of the vertical one", live=True
    )


_Sole = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Soles:
    """The two soles in the world."""

    points: FloatArray  # (2, 3) their middles, m
    axes: FloatArray  # (2, 3, 3) of the feet's link frames, as columns

    @property
    def middle(self) -> FloatArray:
        """The point (3,) between them, m."""
        middle: FloatArray = 0.5 * (self.points[0] + self.points[1])
        return middle


@dataclass(frozen=True)
class GroundWrenches:
    """The wrenches that the ground is to exert on the two feet, world axes."""

    points: FloatArray  # (2, 3) the soles' middles, m
    forces: FloatArray  # (2, 3) N
    moments: FloatArray  # (2, 3) about those points, N m


class BalanceController:
    """The virtual force of a character that stands on two feet, as joint efforts.

    It has no memory: the same state gets the same effort.

    Sources: Pratt et al. 2001, "Virtual Model Control" (the virtual force); Hyon, Hale and Cheng
    2007, "Full-Body Compliant Human-Humanoid Interaction" (the feet's shares, the Jacobians'
    transposes, gravity).
    """

    def __init__(self, character: Character, feet: Sequence[str]) -> None:
        """Find the soles of the two links named: the faces of their boxes below in the rest pose.

        Raises:
            CharacterError: the base is fixed, there are not two feet, or one of them is no link,
                has no box, or is moved by no joint.
        """
        if not character.layout.has_floating_base:
            raise CharacterError(
                f"{character.file}: the base is fixed; there is nothing to balance"
            )
        if len(feet) != 2 or feet[0] == feet[1]:
            given = ", ".join(feet) or "none"
            raise CharacterError(f"{character.file}: balance needs two feet; given: {given}")
        model = DynamicsModel(character)
        model.update(np.array(character.rest_position), np.zeros(character.layout.size))
        self._feet = np.array([_link(character, foot) for foot in feet])
        _, axes = model.link_frames(self._feet)
        soles = [
            _sole(character, model, foot, turn) for foot, turn in zip(self._feet, axes, strict=True)
        ]
        # Of each sole in the frame of its link: the middle (3,), the directions of its edges as
        # columns (3, 2), half their lengths (2,), m, and the normal (3,), away from the ground.
        self._centres, self._edges, self._half_lengths, self._normals = (
            np.array(part) for part in zip(*soles, strict=True)
        )

    def effort(
        self, model: DynamicsModel, gains: BalanceGains, *, with_bias: bool = True
    ) -> FloatArray:
        """The effort (n,) to add to that of the tracking law; `model` has the present state.

        Beside the feet's part it has the bias force, unless the law has that already: where the
        virtual force is the weight's opposite, nothing moves. The root's entries are zero, and all
        are once it has fallen.
        """
        ground = self.ground_wrenches(model, gains)
        effort = model.bias_force() if with_bias else np.zeros(len(model.bias_force()))
        for foot, point, force, moment in zip(
            self._feet, ground.points, ground.forces, ground.moments, strict=True
        ):
            jacobian = model.point_jacobian(foot, point)
            effort -= fixed_order.apply(jacobian.T, np.concatenate((force, moment)))
        effort[:_ROOT_ENTRIES] = 0.0
        return effort * self._footing(model)

    def _footing(self, model: DynamicsModel) -> float:
        """1 while a foot can be flat on the ground, 0 when both are tilted too far."""
        _, axes = model.link_frames(self._feet)
        level = float(fixed_order.dot(axes[:, 2], self._normals).max())
        return min(max((level - _NO_FOOTING) / (_FULL_FOOTING - _NO_FOOTING), 0.0), 1.0)

    def ground_wrenches(self, model: DynamicsModel, gains: BalanceGains) -> GroundWrenches:
        """The virtual force, shared by the feet, and its moment as far as their soles bear it.

        Where they do not bear it all, the force acts beside the centre of mass and turns the body,
        which bends at the hips.
        """
        soles = self.soles(model)
        arm = model.centre_of_mass() - soles.middle
        force = _virtual_force(model, arm, gains)
        return self.shared(soles, force, fixed_order.cross(arm, force))

    def soles(self, model: DynamicsModel) -> Soles:
        """Where the soles are in the state that `model` has."""
        origins, axes = model.link_frames(self._feet)
        return Soles(origins + fixed_order.apply(axes, self._centres), axes)

    def jacobians(self, model: DynamicsModel, soles: Soles) -> FloatArray:
        """The Jacobians (2, 6, n) of the soles' middles, as `DynamicsModel.point_jacobian`."""
        pairs = zip(self._feet, soles.points, strict=True)
        return np.array([model.point_jacobian(foot, point) for foot, point in pairs])

    def shared(self, soles: Soles, force: FloatArray, moment: FloatArray) -> GroundWrenches:
        """The feet's wrenches of a force (3,) and its moment (3,) about the soles' middle."""
        points, across = soles.points, soles.points[1] - soles.points[0]
        shift = _shift(moment, across, float(force[2]))
        moment = moment - shift * fixed_order.cross(across, force)
        shares = np.array(((0.5 - shift,), (0.5 + shift,)))
        edges = fixed_order.product(soles.axes, self._edges).swapaxes(-1, -2)  # now as rows
        limits = shares * force[2] * self._half_lengths[:, ::-1]
        return GroundWrenches(points, shares * force, _bearable(shares * moment, edges, limits))


def _virtual_force(model: DynamicsModel, offset: FloatArray, gains: BalanceGains) -> FloatArray:
    """The force (3,) on a centre of mass that is at an offset (3,) from the feet's middle, m.

    It is one that feet can exert: upwards, not too large, and inside the cone of friction.
    """
    velocity = model.centre_of_mass_velocity()
    force = -gains.stiffness * offset - gains.damping * velocity
    vertical = model.weight - gains.damping * float(velocity[2])
    force[2] = max(min(vertical, _MOST_LOAD * model.weight), _LEAST_LOAD)
    horizontal, bound = float(fixed_order.norm(force[:2])), gains.friction * float(force[2])
    if horizontal > bound:
        force[:2] *= bound / horizontal
    return force


def _shift(moment: FloatArray, across: FloatArray, load: float) -> float:
    """Which share of the load, beside a half, goes to the second foot: -0.5 to 0.5.

    The centre of pressure comes as near to the one of the moment (3,) about the feet's middle as
    it can on the line `across` (3,) from the first foot to the second.
    """
    x, y, _ = across.tolist()
    tipping = y * float(moment[0]) - x * float(moment[1])
    wanted: float = tipping / max(load * (x * x + y * y), _LEAST_TIPPING)
    return min(max(wanted, -0.5), 0.5)


def _bearable(moments: FloatArray, edges: FloatArray, limits: FloatArray) -> FloatArray:
    """The part of moments (2, 3) that soles bear about their edges (2, 2, 3), which are rows.

    With each at most its limit (2, 2) in N m, the load times half the other edge's length, the
    centre of pressure is inside the sole.
    """
    about_edges = fixed_order.apply(edges, moments)
    bounded = np.minimum(np.maximum(about_edges, -limits), limits)
    return fixed_order.apply(edges.swapaxes(-1, -2), bounded)


def _link(character: Character, name: str) -> int:
    names = [link.name for link in character.links]
    if name not in names:
        raise CharacterError(f"{character.file}: {one_of('foot', name, names)}")
    return names.index(name)


def _sole(character: Character, model: DynamicsModel, foot: int, axes: FloatArray) -> _Sole:
    """Middle, edges, half lengths and normal of the lower face of a foot's box.

    `axes` (3, 3) are those of the link frame in the rest pose.
    """
    link = character.links[foot]
    if not model.point_jacobian(foot, np.zeros(3))[:, _ROOT_ENTRIES:].any():
        raise CharacterError(f"{character.file}: no joint moves the foot '{link.name}'")
    boxes = [shape for shape in link.shapes if shape.type is ShapeType.BOX]
    if not boxes:
        raise CharacterError(f"{character.file}: the foot '{link.name}' has no box, so no sole")
    pose, half = boxes[0].pose, 0.5 * np.array(boxes[0].size)
    turn = rotations.matrix(np.array(pose.orientation_xyzw))
    heights = fixed_order.apply(turn.T, axes[2])  # z components in the world of the box's axes
    normal = int(np.argmax(np.abs(heights)))
    up = np.copysign(1.0, heights[normal]) * turn[:, normal]
    others = [axis for axis in range(3) if axis != normal]
    centre = np.array(pose.position) - half[normal] * up
    return centre, turn[:, others], half[others], up
