"""The space that each link takes, as spheres: which links may touch each other, or the ground."""

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Character, Link, Shape, ShapeType
from msgs_config.geometry import fixed_order, rotations

_MOST_SPHERES = 12  # spheres in a row along one shape


class BoundingSpheres:
    """Spheres around every link's shapes. A link that has no shapes is nowhere."""

    def __init__(self, character: Character) -> None:
        centres: list[FloatArray] = []
        radii: list[float] = []
        owners: list[int] = []
        for number, link in enumerate(character.links):
            for shape in link.shapes:
                along, radius = _spheres(link, shape)
                centres += list(along)
                radii += [radius] * len(along)
                owners += [number] * len(along)
        self._centres = np.array(centres).reshape(-1, 3)
        self._radii = np.array(radii)
        self._owners: IntArray = np.array(owners, dtype=np.intp)
        self._links = len(character.links)
        self._adjacent = np.zeros((self._links, self._links), dtype=np.bool_)
        for number, link in enumerate(character.links):
            if link.parent >= 0:
                self._adjacent[number, link.parent] = self._adjacent[link.parent, number] = True

    def centres(self, origins: FloatArray, turns_xyzw: FloatArray) -> FloatArray:
        """Centres (s, 3) of the spheres, m, where link frames are at (links, 3) and (links, 4)."""
        axes = rotations.matrix(turns_xyzw)[self._owners]
        return origins[self._owners] + fixed_order.apply(axes, self._centres)

    def lowest(self, centres: FloatArray) -> FloatArray:
        """The height (links,) in m that a link reaches down to; infinite without shapes."""
        heights = np.full(self._links, np.inf)
        np.minimum.at(heights, self._owners, centres[:, 2] - self._radii)
        return heights

    def within_reach(self, centres: FloatArray, links: IntArray, margin: float) -> BoolArray:
        """Which of some links (m,) may touch each other, (m, m): nearer than a margin in m.

        A link and its neighbour in the tree are not: they do not collide.
        """
        chosen = [np.flatnonzero(self._owners == link) for link in links]
        reach = np.zeros((len(links), len(links)), dtype=np.bool_)
        for one in range(len(links)):
            for other in range(one):
                apart = centres[chosen[one], np.newaxis] - centres[chosen[other]]
                gaps = fixed_order.norm(apart)
                gaps -= self._radii[chosen[one], np.newaxis] + self._radii[chosen[other]]
                near = bool(gaps.size) and float(gaps.min()) < margin
                near = near and not self._adjacent[links[one], links[other]]
                reach[one, other] = reach[other, one] = near
        return reach


def _spheres(link: Link, shape: Shape) -> tuple[FloatArray, float]:
    """Centres (s, 3) in the link frame and the radius of spheres that cover a shape.

    Of a mesh nothing but its link's mass is known here: a ball of the largest inertia.
    """
    if shape.type is ShapeType.MESH:
        inertia = max(link.inertia_diagonal) / link.mass if link.mass else 0.0
        return np.array([link.inertial_pose.position]), float(np.sqrt(2.5 * inertia))
    if shape.type is ShapeType.SPHERE:
        half, radius, axis = 0.0, shape.size[0], 2
    elif shape.type is ShapeType.BOX:
        axis = int(np.argmax(shape.size))
        others = np.delete(np.array(shape.size), axis)
        half, radius = 0.5 * shape.size[axis], 0.5 * float(fixed_order.norm(others))
    else:  # capsule, cylinder: radius, length
        half, radius, axis = 0.5 * shape.size[1], shape.size[0], 2
    count = min(int(np.ceil(2.0 * half / max(radius, 1e-6))) + 1, _MOST_SPHERES)
    along = np.zeros((count, 3))
    if count > 1:
        along[:, axis] = np.linspace(-half, half, count)
    turn = np.array(shape.pose.orientation_xyzw)
    return rotations.rotate(turn, along) + np.array(shape.pose.position), radius
