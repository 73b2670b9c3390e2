"""Inverse kinematics of a whole motion: Gauss-Newton on all frames at once.

Each frame has residuals: turns and places of links against what they should be, points below the
ground, shapes that overlap, joints beyond their limits. Second differences of the coordinates join
the frames, so the motion is smooth where the residuals leave it free. Jacobians are MuJoCo's.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from character_motion.retargeting.optimisation.capsules import Capsules
from character_motion.retargeting.optimisation.goals import Goals
from character_motion.retargeting.optimisation.smooth_least_squares import solve_smooth
from character_motion.retargeting.target_body import TargetBody
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.geometry import fixed_order, rotations

_USUAL_FRAME = 1.0 / 60.0  # s: the residuals of a frame of this duration count once
_DAMPING = 1e-2  # added to each block at least, for coordinates that no residual is about
# Factors of the damping after a step that failed and one that did well, and its bound.
_DAMPING_INCREASE, _DAMPING_DECREASE, _MOST_DAMPING = 8.0, 4.0, 1e6
_FIXED_FRAME_DAMPING = 1e12  # added where frames are fixed
_LARGEST_STEP = 0.4  # rad or m
_LAST_STEP = 3e-4  # rad or m of the largest step, at which an iteration ends
_ACTIVE_SETS = 5  # times that a step is solved while bounds come and go
_WINDOW, _OVERLAP = 480, 60  # frames that are solved at once, and those solved once more
# Two shapes that are so far apart at first, m, are not brought together by a solution.
_NEAR_DISTANCE = 0.2
# So many points of the surface, the lowest ones of each frame, are kept over the ground.
_GROUND_POINTS_A_FRAME = 40
_PAIRS_A_FRAME = 8  # pairs of shapes a frame that are kept apart, the nearest ones

Linear = tuple[FloatArray, FloatArray]
"""Jacobians (f, m, n) of m residuals in f frames, and what is missing (f, m)."""

Progress = Callable[[int, int], None]
"""Is told how many frames are done, and of how many."""


class InverseKinematics:
    """Finds the motion of a character that does best what some goals say."""

    def __init__(self, target: TargetBody, frame_time: float, iterations: int = 25) -> None:
        self._layout, self._link_count = target.character.layout, len(target.character.links)
        self._bounds = target.bounds
        self._hard = target.character.position_bounds()
        self._model = DynamicsModel(target.character)
        self._frame_time = frame_time
        self._iterations = iterations

    def solve(
        self, start: GeneralizedPosition, goals: Goals, progress: Progress | None = None
    ) -> GeneralizedPosition:
        """The motion (f, n) from a first guess; long ones in windows that go on from each other."""
        frames = len(start.position)
        positions, turns = start.position.copy(), start.orientations_xyzw.copy()
        first = 0
        while True:
            end = min(first + _WINDOW, frames)
            fixed = 2 if first else 0
            window = slice(first, end)
            guess = GeneralizedPosition(positions[window], turns[window])
            solved = self._solve_window(guess, goals.part(window), fixed)
            positions[window], turns[window] = solved.position, solved.orientations_xyzw
            if progress is not None:
                progress(end, frames)
            if end == frames:
                return GeneralizedPosition(positions, turns)
            first = end - _OVERLAP

    def _solve_window(
        self, guess: GeneralizedPosition, goals: Goals, fixed: int
    ) -> GeneralizedPosition:
        """The motion of a window, the first frames of which are fixed (Levenberg-Marquardt)."""
        goals = replace(goals, capsules=self._near_capsules(guess, goals.capsules))
        spring = 1.0 / (goals.acceleration * self._frame_time**2)
        weights = self._frame_time / _USUAL_FRAME * spring**2
        damping, now = _DAMPING, self._linearised(guess, goals, weights)
        for _ in range(self._iterations):
            step = self._step(now, weights, damping, fixed)
            largest = np.abs(step).max(axis=1, keepdims=True)
            step *= np.minimum(1.0, _LARGEST_STEP / np.maximum(largest, 1e-12))
            then = self._linearised(self._moved(now.motion, step), goals, weights)
            if then.cost < now.cost:
                now, damping = then, max(damping / _DAMPING_DECREASE, _DAMPING)
            else:
                damping *= _DAMPING_INCREASE
            if float(largest.max()) < _LAST_STEP or damping > _MOST_DAMPING:
                break
        return now.motion

    def _step(
        self, now: "_Linearised", weights: FloatArray, damping: float, fixed: int
    ) -> FloatArray:
        """The step (f, n) that does best, with those bounds that it would cross."""
        quadratic, gradient = _normal_equations(*now.wanted)
        diagonal = np.arange(quadratic.shape[-1])
        quadratic[:, diagonal, diagonal] += damping
        quadratic[:fixed, diagonal, diagonal] += _FIXED_FRAME_DAMPING
        limit, missing = now.bounded
        active = missing > 0.0
        for _ in range(_ACTIVE_SETS):
            counting = _normal_equations(limit * active[..., np.newaxis], missing * active)
            blocks, gradients = quadratic + counting[0], gradient + counting[1]
            step = solve_smooth(blocks, gradients, weights, now.accelerations)
            left = missing - np.matmul(limit, step[..., np.newaxis])[..., 0]
            before, active = active, left > 0.0
            if (before == active).all():
                break
        return step

    def _moved(self, now: GeneralizedPosition, step: FloatArray) -> GeneralizedPosition:
        entries = self._layout.rotation_entries
        turns = rotations.multiply(now.orientations_xyzw, rotations.exp(step[:, entries]))
        turns = rotations.normalised(turns)
        positions = np.clip(now.position + step, *self._hard)
        positions[:, entries] = rotations.log(turns)
        return GeneralizedPosition(positions, turns)

    def _linearised(
        self, now: GeneralizedPosition, goals: Goals, weights: FloatArray
    ) -> "_Linearised":
        """A motion with its residuals; accelerations have weights (n,)."""
        of_each = goals.links, goals.point_links, goals.surface.links, goals.capsules.links
        used, index = np.unique(np.concatenate(of_each), return_inverse=True)
        origins, axes, jacobians = self._kinematics(now.position, used)
        ends = np.cumsum([len(links) for links in of_each[:-1]])
        turned, placed, touching, shaped = np.split(index, ends)
        capsules = replace(goals.capsules, links=shaped)
        wanted = (
            self._turns(goals, axes[:, turned], jacobians[:, turned]),
            self._places(goals, origins[:, placed], axes[:, placed], jacobians[:, placed]),
        )
        bounded = (
            self._ground(goals, origins[:, touching], axes[:, touching], jacobians, touching),
            _apart(capsules, goals.overlap_weight, origins, axes, jacobians),
            *self._limits(goals, now),
        )
        share = float(np.sqrt(self._frame_time / _USUAL_FRAME))
        velocity = self._layout.difference(_rows(now, slice(-1)), _rows(now, slice(1, None)))
        accelerations = np.diff(velocity, axis=0)
        stacked = _stacked(wanted, share), _stacked(bounded, share)
        cost = (
            float(np.square(stacked[0][1]).sum())
            + float(np.square(np.maximum(stacked[1][1], 0.0)).sum())
            + float((weights * np.square(accelerations)).sum())
        )
        return _Linearised(now, *stacked, accelerations, cost)

    def _kinematics(
        self, positions: FloatArray, links: IntArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Origins (f, l, 3), axes (f, l, 3, 3) and Jacobians (f, l, 6, n) of the origins."""
        frames, size = positions.shape
        origins, axes = np.empty((frames, len(links), 3)), np.empty((frames, len(links), 3, 3))
        jacobians = np.empty((frames, len(links), 6, size))
        still = np.zeros(size)
        for frame, position in enumerate(positions):
            self._model.update(position, still)
            origins[frame], axes[frame] = self._model.link_frames(links)
            for row, link in enumerate(links.tolist()):
                jacobians[frame, row] = self._model.point_jacobian(link, origins[frame, row])
        return origins, axes, jacobians

    def _near_capsules(self, motion: GeneralizedPosition, capsules: Capsules) -> Capsules:
        """The capsules with those pairs alone that come near to each other in a motion."""
        links = np.arange(self._link_count)
        frames, still = len(motion.position), np.zeros(self._layout.size)
        origins, axes = np.empty((frames, len(links), 3)), np.empty((frames, len(links), 3, 3))
        for frame, position in enumerate(motion.position):
            self._model.update(position, still)
            origins[frame], axes[frame] = self._model.link_frames(links)
        distance = capsules.nearest(origins, axes).distance
        return capsules.of_pairs(np.flatnonzero((distance < _NEAR_DISTANCE).any(axis=0)))

    def _turns(
        self, goals: Goals, axes: FloatArray, jacobians: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        wanted = rotations.matrix(goals.turns_xyzw)
        missing = _rotation_vectors(np.matmul(wanted, axes.swapaxes(-1, -2)))
        weighted = np.matmul(goals.turn_weights, jacobians[:, :, 3:])
        frames, size = len(axes), jacobians.shape[-1]
        residual = np.matmul(goals.turn_weights, missing[..., np.newaxis])[..., 0]
        return weighted.reshape(frames, -1, size), residual.reshape(frames, -1)

    def _places(
        self, goals: Goals, origins: FloatArray, axes: FloatArray, jacobians: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        arms = np.matmul(axes, goals.point_offsets[..., np.newaxis])[..., 0]
        moving = _point_jacobians(jacobians, arms) * goals.place_weights[..., np.newaxis]
        missing = (goals.places - origins - arms) * goals.place_weights
        frames, size = len(axes), jacobians.shape[-1]
        return moving.reshape(frames, -1, size), missing.reshape(frames, -1)

    def _ground(
        self,
        goals: Goals,
        origins: FloatArray,
        axes: FloatArray,
        jacobians: FloatArray,
        links: IntArray,
    ) -> tuple[FloatArray, FloatArray]:
        arms = np.matmul(axes, goals.surface.offsets[..., np.newaxis])[..., 0]
        heights = origins[..., 2] + arms[..., 2] - goals.surface.radii
        missing = goals.clearance - heights
        rows = np.arange(len(missing))[:, np.newaxis]
        lowest = np.argsort(-missing, axis=1, kind="stable")[:, :_GROUND_POINTS_A_FRAME]
        rising = _point_jacobians(jacobians[rows, links[lowest]], arms[rows, lowest])[:, :, 2]
        return goals.ground_weight * rising, goals.ground_weight * missing[rows, lowest]

    def _limits(self, goals: Goals, now: GeneralizedPosition) -> tuple[Linear, Linear]:
        """How the coordinates that have bounds go from them inwards, lower ones and upper ones."""
        lower, upper = self._bounds
        jacobian = np.tile(np.eye(now.position.shape[1]), (len(now.position), 1, 1))
        for entries in self._layout.rotation_entries:
            rate = rotations.right_jacobian_inverse(now.position[:, entries])
            jacobian[:, entries[:, np.newaxis], entries] = rate
        low, high = np.isfinite(lower), np.isfinite(upper)
        weight = goals.limit_weight
        return (
            (weight * jacobian[:, low], weight * (lower - now.position)[:, low]),
            (-weight * jacobian[:, high], weight * (now.position - upper)[:, high]),
        )


def _stacked(parts: Sequence[Linear], share: float) -> Linear:
    jacobians, missing = zip(*parts, strict=True)
    return share * np.concatenate(jacobians, axis=1), share * np.concatenate(missing, axis=1)


@dataclass(frozen=True)
class _Linearised:
    """A motion, and how its residuals change."""

    motion: GeneralizedPosition
    wanted: Linear
    bounded: Linear  # residuals that count only where something is missing
    accelerations: FloatArray  # (f - 2, n), per frame
    cost: float


def _normal_equations(jacobian: FloatArray, missing: FloatArray) -> Linear:
    """`J' J` (f, n, n) and `J' r` (f, n)."""
    transposed = jacobian.swapaxes(-1, -2)
    return np.matmul(transposed, jacobian), np.matmul(transposed, missing[..., np.newaxis])[..., 0]


def _rows(motion: GeneralizedPosition, rows: slice) -> GeneralizedPosition:
    return GeneralizedPosition(motion.position[rows], motion.orientations_xyzw[rows])


def _apart(
    capsules: Capsules,
    weight: float,
    origins: FloatArray,
    axes: FloatArray,
    jacobians: FloatArray,
) -> Linear:
    """How the nearest pairs of shapes go from each other, and by how much they must."""
    near = capsules.nearest(origins, axes)
    missing = capsules.margins - near.distance
    count = min(_PAIRS_A_FRAME, missing.shape[1])
    rows = np.arange(len(missing))[:, np.newaxis]
    pairs = np.argsort(-missing, axis=1, kind="stable")[:, :count]
    direction = near.direction[rows, pairs]
    leaving = np.zeros((*pairs.shape, jacobians.shape[-1]))
    for side, points, sign in ((0, near.first, 1.0), (1, near.second, -1.0)):
        links = capsules.links[capsules.pairs[pairs, side]]
        moment = fixed_order.cross(points[rows, pairs] - origins[rows, links], direction)
        wrench = sign * np.concatenate((direction, moment), axis=-1)
        leaving += np.matmul(wrench[..., np.newaxis, :], jacobians[rows, links])[..., 0, :]
    return weight * leaving, weight * missing[rows, pairs]


def _point_jacobians(jacobians: FloatArray, arms: FloatArray) -> FloatArray:
    """The velocities (f, p, 3, n) of points at arms (f, p, 3) from the origins of their links."""
    turning = jacobians[:, :, 3:].swapaxes(-1, -2)  # (f, p, n, 3)
    carried = fixed_order.cross(turning, arms[:, :, np.newaxis])
    moving: FloatArray = jacobians[:, :, :3] + carried.swapaxes(-1, -2)
    return moving


def _rotation_vectors(matrices: FloatArray) -> FloatArray:
    """The rotation vectors (..., 3) of rotation matrices (..., 3, 3)."""
    from character_motion.retargeting.conventions import quaternion

    return rotations.log(quaternion(matrices))
