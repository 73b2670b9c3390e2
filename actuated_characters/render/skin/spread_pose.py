"""A pose in which what is not joined is apart, so that a skin joins nothing else."""

from collections.abc import Sequence

import numpy as np

from actuated_characters.render.skin.cores import Core
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order, rotations

_TURNS = (0.4, -0.4, 0.8, -0.8, 1.2, -1.2)  # rad, tried about each axis of each joint
_SWEEPS = 2  # over all joints
_MOST_CORES = 80  # of a character that is not left at rest
_SAMPLES = 4  # points along a core
_GAP = 1.2  # how far apart links are to be, in radii of the thicker one
# What a turn by one radian must bring at least, m: more, the more of the body it moves.
_EFFORT, _EFFORT_OF_BODY = 0.01, 0.8


def spread_pose(character: Character, cores: Sequence[Sequence[Core]]) -> FloatArray:
    """The position (n,), message form, at rest but for turns that part links from each other.

    The floating base is at the origin and not turned, so that it is one pose wherever a character
    stands.

    Args:
        character: Whose.
        cores: Of the shapes of each link, in its frame.
    """
    position = np.array(character.rest_position)
    position[character.layout.joints[0].entries] = 0.0
    if sum(map(len, cores)) > _MOST_CORES:  # each with each other one would take minutes
        return position
    gaps = _Gaps(character, cores)
    best = gaps.total(position)
    for entry, share in _turning_entries(character) * _SWEEPS:
        if best >= gaps.most:
            break
        at = position[entry]
        for turn in _TURNS:
            tried = position.copy()
            tried[entry] = at + turn
            total = gaps.total(tried) - (_EFFORT + _EFFORT_OF_BODY * share) * abs(turn)
            if total > best:
                best, position = total, tried
    return position


class _Gaps:
    """How far apart those links are that no joint connects."""

    def __init__(self, character: Character, cores: Sequence[Sequence[Core]]) -> None:
        self._model = DynamicsModel(character)
        most = max(len(own) for own in cores)
        self._points = np.full((len(cores), most, _SAMPLES, 3), np.nan)
        self._radii = np.zeros((len(cores), most, 1))
        shares = np.linspace(0.0, 1.0, _SAMPLES)[:, np.newaxis]
        for row, own in enumerate(cores):
            for number, core in enumerate(own):
                start, end = core.ends
                self._points[row, number] = start + shares * (end - start)
                self._radii[row, number] = core.radius
        self._counts = _are_apart(character, cores)
        thickest = self._radii.max(axis=(1, 2))
        self._wanted = _GAP * np.maximum(thickest, thickest[:, np.newaxis])
        self.most = float(self._wanted[self._counts].sum())

    def total(self, position: FloatArray) -> float:
        """The gaps of all pairs, each as far as it counts, m."""
        self._model.update(position, np.zeros_like(position))
        origins, turns_xyzw = self._model.link_poses()
        turns = rotations.matrix(turns_xyzw)[:, np.newaxis, np.newaxis]
        places = fixed_order.apply(turns, self._points) + origins[:, np.newaxis, np.newaxis]
        count, size = len(places), places.shape[1] * places.shape[2]
        flat = places.reshape(count, size, 3)
        radii = np.broadcast_to(self._radii, places.shape[:3]).reshape(count, size)
        ways = flat[:, :, np.newaxis, np.newaxis] - flat
        apart = np.sqrt((ways**2).sum(axis=-1)) - radii[:, :, np.newaxis, np.newaxis] - radii
        least = np.nanmin(np.where(np.isfinite(apart), apart, np.inf), axis=(1, 3))
        return float(np.minimum(least, self._wanted)[self._counts].sum())


def _are_apart(character: Character, cores: Sequence[Sequence[Core]]) -> BoolArray:
    """Which pairs (l, l) of links count: both are seen, and no joint connects them; once each."""
    seen = np.array([bool(own) for own in cores])
    count: BoolArray = np.triu(seen & seen[:, np.newaxis], 1)
    for row, link in enumerate(character.links):
        if link.parent >= 0:
            count[link.parent, row] = count[row, link.parent] = False
    return count


def _turning_entries(character: Character) -> list[tuple[int, float]]:
    """The entries of a position that turn links about another one, the outermost joints first.

    With each the share of the mass that it turns.
    """
    beyond = masses_beyond(character)
    shares = {
        link.joint.name: float(mass) / character.mass
        for link, mass in zip(character.links, beyond, strict=True)
    }
    types = (JointType.REVOLUTE, JointType.SPHERICAL)
    joints = [joint for joint in character.layout.joints if joint.type in types]
    entries = range(character.layout.size)
    return [(entry, shares[each.name]) for each in joints[::-1] for entry in entries[each.entries]]


def masses_beyond(character: Character) -> FloatArray:
    """The mass (l,) of each link with all that hangs on it, kg."""
    masses = np.array([link.mass for link in character.links])
    for row in range(len(masses) - 1, 0, -1):
        masses[character.links[row].parent] += masses[row]
    return masses
