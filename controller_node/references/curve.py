"""Piecewise polynomials through knots on a configuration space, ball joints and base included."""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.geometry import fixed_order, rotations

# The coefficients of u, u^2, ... of a polynomial on 0 <= u <= 1 that begins at zero, a row each;
# the columns are its end, its first derivatives at 0 and at 1, and its second ones.
_LINEAR = np.array([[1.0]])
_CUBIC = np.array([[0.0, 1.0, 0.0], [3.0, -2.0, -1.0], [-2.0, 1.0, 1.0]])
QUINTIC = np.array(
    [
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.5, 0.0],
        [10.0, -6.0, -4.0, -1.5, 0.5],
        [-15.0, 8.0, 7.0, 1.5, -1.0],
        [6.0, -3.0, -3.0, -0.5, 0.5],
    ]
)
_DEGREE = len(QUINTIC)

REST_TIME = 0.3
"""s, in which a path comes from rest to a first knot that moves, or to rest from a last one."""


@dataclass(frozen=True)
class Knots:
    """The p configurations of a curve at rising times, with velocities and accelerations if set.

    Without velocities the curve between them is linear, with velocities cubic, with accelerations
    too it is quintic.
    """

    times: FloatArray  # (p,) s
    configurations: GeneralizedPosition  # (p, n), (p, k, 4)
    velocities: FloatArray | None = None  # (p, n), a rotation's in the child frame
    accelerations: FloatArray | None = None  # (p, n), their rates of change

    def __getitem__(self, rows: slice) -> "Knots":
        """Some of the knots, in order."""
        whole = self.configurations
        return Knots(
            self.times[rows],
            GeneralizedPosition(whole.position[rows], whole.orientations_xyzw[rows]),
            None if self.velocities is None else self.velocities[rows],
            None if self.accelerations is None else self.accelerations[rows],
        )


class Curve:
    """A motion through knots, at rest before the first and from the last one on.

    Between two knots each coordinate is a polynomial in time, and so is the rotation vector r of
    each rotation `q_i exp(r)`, where `q_i` is the rotation at the knot before. It takes the shorter
    way round. Where knots have velocities (accelerations) the curve's own are continuous, since
    those of r at a segment's ends are made from them.
    """

    def __init__(self, layout: JointLayout, *parts: Knots) -> None:
        """Join parts of any degrees; each begins with the last knot of the one before."""
        self._layout = layout
        first, *others = parts
        later = [part.times[1:] for part in others]
        self._knot_times: list[float] = np.concatenate([first.times, *later]).tolist()
        self._positions = np.concatenate([part.configurations.position[:-1] for part in parts])
        self._orientations = np.concatenate(
            [part.configurations.orientations_xyzw[:-1] for part in parts]
        )
        self._coefficients = np.concatenate([_coefficients(layout, part) for part in parts])
        self._at_first = self._at_rest(first.configurations, 0)
        self._at_last = self._at_rest(parts[-1].configurations, -1)

    @property
    def start(self) -> float:
        """Time in s of the first knot."""
        return self._knot_times[0]

    def sample(self, time: float) -> ReferenceState:
        """The state at a time in s, on the clock of the knots."""
        if time < self._knot_times[0]:
            return self._at_first
        if time >= self._knot_times[-1]:
            return self._at_last
        segment = bisect_right(self._knot_times, time) - 1
        moved, velocity, acceleration = self._polynomials(segment, time)
        position, orientations = self._positions[segment] + moved, self._orientations[segment]
        entries = self._layout.rotation_entries
        if not len(entries):
            return ReferenceState(
                GeneralizedPosition(position, orientations), velocity, acceleration
            )
        turned = moved[entries]
        orientations = rotations.multiply(orientations, rotations.exp(turned))
        position[entries] = rotations.log(orientations)
        velocity[entries], acceleration[entries] = rotations.angular_motion(
            turned, velocity[entries], acceleration[entries]
        )
        return ReferenceState(GeneralizedPosition(position, orientations), velocity, acceleration)

    def configurations(self, times: FloatArray) -> GeneralizedPosition:
        """The configurations (m, n), (m, k, 4) at times (m,) in s, as `sample` has them."""
        begins, ends = np.array(self._knot_times[:-1]), np.array(self._knot_times[1:])
        segments = np.searchsorted(begins, times, side="right").clip(1, len(begins)) - 1
        u = ((times - begins[segments]) / (ends - begins)[segments]).clip(0.0, 1.0)
        powers = fixed_order.powers(u, _DEGREE + 1)[:, 1:, np.newaxis]
        moved = fixed_order.total(powers * self._coefficients[segments], axis=1)
        entries = self._layout.rotation_entries
        turned = rotations.exp(moved[:, entries])
        orientations = rotations.multiply(self._orientations[segments], turned)
        positions = self._positions[segments] + moved
        positions[:, entries] = rotations.log(orientations)
        return GeneralizedPosition(positions, orientations)

    def coordinate(self, entry: int, shares: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Times in s and values of a hinge or slider at shares (m,) of each segment, (p - 1, m)."""
        begins = np.array(self._knot_times[:-1])[:, np.newaxis]
        durations = np.diff(self._knot_times)[:, np.newaxis]
        powers = fixed_order.powers(shares, _DEGREE + 1)[:, 1:].T
        moved = fixed_order.product(self._coefficients[:, :, entry], powers)
        return begins + durations * shares, self._positions[:, entry, np.newaxis] + moved

    def _polynomials(self, segment: int, time: float) -> FloatArray:
        """The segment's polynomials and their first two derivatives, (3, n)."""
        begin = self._knot_times[segment]
        rate = 1.0 / (self._knot_times[segment + 1] - begin)
        u = (time - begin) * rate
        u2, u3, u4 = u * u, u * u * u, u * u * u * u
        first, second = rate, rate * rate
        basis = np.array(
            [
                [u, u2, u3, u4, u4 * u],
                [first, 2.0 * first * u, 3.0 * first * u2, 4.0 * first * u3, 5.0 * first * u4],
                [0.0, 2.0 * second, 6.0 * second * u, 12.0 * second * u2, 20.0 * second * u3],
            ]
        )
        return fixed_order.product(basis, self._coefficients[segment])

    def _at_rest(self, configurations: GeneralizedPosition, knot: int) -> ReferenceState:
        position = configurations.position[knot].copy()
        orientations = configurations.orientations_xyzw[knot]
        position[self._layout.rotation_entries] = rotations.log(orientations)
        still = np.zeros(self._layout.size)
        return ReferenceState(GeneralizedPosition(position, orientations), still, still)


def segment_offsets(layout: JointLayout, configurations: GeneralizedPosition) -> FloatArray:
    """The difference from each configuration (p, n) to the next, (p - 1, n): rad and m."""
    position, orientations = configurations.position, configurations.orientations_xyzw
    return layout.difference(
        GeneralizedPosition(position[:-1], orientations[:-1]),
        GeneralizedPosition(position[1:], orientations[1:]),
    )


def smooth_knots(
    layout: JointLayout,
    times: FloatArray,
    configurations: GeneralizedPosition,
    velocities: FloatArray | None = None,
    own_accelerations: FloatArray | None = None,
    *,
    loops: bool,
) -> Knots:
    """Knots whose curve is continuous to the acceleration.

    At a configuration it moves as the parabola through this one and its two neighbours does, at the
    two ends of what is no loop it is at rest. Where there is a velocity (p, n), and not NaN, it
    moves as the cubic with this velocity through the three does, which is the parabola if the
    velocity is that of the parabola. Where there is an acceleration (p, n), and not NaN, it has
    this one. The last configuration of a loop is its first one.
    """
    durations = np.diff(times)[:, np.newaxis]
    slopes = segment_offsets(layout, configurations) / durations
    around = _around_knots(slopes, durations, loops=loops)
    rates, accelerations = _parabolas(*around)
    if not loops:
        for each in (rates, accelerations):
            each[[0, -1]] = 0.0
    if velocities is not None:
        is_own = ~np.isnan(velocities)
        rates = np.where(is_own, velocities, rates)
        accelerations = np.where(is_own, _cubic_accelerations(*around, rates), accelerations)
    if own_accelerations is not None:
        is_own = ~np.isnan(own_accelerations)
        accelerations = np.where(is_own, own_accelerations, accelerations)
    return Knots(times, configurations, rates, accelerations)


def _around_knots(
    slopes: FloatArray, durations: FloatArray, *, loops: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Slopes before and after each knot (p, n), of those (p - 1, n) between, and durations (p, 1).

    Before the first and after the last knot of what is no loop it is as if that came once more.
    They are in exponential coordinates about the knot, where what leads back to the knot before is
    the negative of what leads from there.
    """
    if loops:
        rows = [-1, *range(len(slopes))]
        return slopes[rows], closed(slopes), durations[rows], closed(durations)
    still, rest = np.zeros((1, slopes.shape[1])), np.full((1, 1), REST_TIME)
    return (
        np.concatenate([still, slopes]),
        np.concatenate([slopes, still]),
        np.concatenate([rest, durations]),
        np.concatenate([durations, rest]),
    )


def _parabolas(
    before: FloatArray, after: FloatArray, time_before: FloatArray, time_after: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Velocity and acceleration (p, n) of the parabola with such slopes (p, n) beside its middle.

    The times (p, 1) are those in s from the neighbour before, and to the one after.
    """
    both = time_before + time_after
    velocities = (before * time_after + after * time_before) / both
    accelerations = 2.0 * (after - before) / both
    return velocities, accelerations


def _cubic_accelerations(
    before: FloatArray,
    after: FloatArray,
    time_before: FloatArray,
    time_after: FloatArray,
    velocities: FloatArray,
) -> FloatArray:
    """Acceleration (p, n) of the cubic with such velocities (p, n), else as `_parabolas`."""
    share = time_before / time_after
    accelerations: FloatArray = (
        2.0
        * ((after - velocities) * share + (velocities - before) / share)
        / (time_before + time_after)
    )
    return accelerations


def from_and_to_rest(knots: Knots) -> Knots:
    """The knots, and beyond each end that moves its configuration once more, at rest."""
    assert knots.velocities is not None and knots.accelerations is not None
    rates = np.stack([knots.velocities, knots.accelerations])
    rows = list(range(len(knots.times)))
    times, still = knots.times, np.zeros((2, 1, rates.shape[2]))
    if rates[:, 0].any():
        rows.insert(0, 0)
        times, rates = np.insert(times, 0, times[0] - REST_TIME), np.append(still, rates, axis=1)
    if rates[:, -1].any():
        rows.append(rows[-1])
        times, rates = np.append(times, times[-1] + REST_TIME), np.append(rates, still, axis=1)
    whole = knots.configurations
    configurations = GeneralizedPosition(whole.position[rows], whole.orientations_xyzw[rows])
    return Knots(times, configurations, rates[0], rates[1])


def closed(rows: FloatArray) -> FloatArray:
    """The rows, with the first once more at the end."""
    return np.concatenate([rows, rows[:1]])


def _coefficients(layout: JointLayout, knots: Knots) -> FloatArray:
    """Coefficients (p - 1, 5, n) of u, u^2, ... where u goes from 0 to 1 over each segment."""
    ends = segment_offsets(layout, knots.configurations)
    durations = np.diff(knots.times)[:, np.newaxis]
    conditions, table = [ends], _LINEAR
    velocities, accelerations = knots.velocities, knots.accelerations
    if velocities is not None:
        # at its first knot a rotation vector is zero, and its rates are those of the rotation
        rates, entries = velocities[1:].copy(), layout.rotation_entries
        second_rates = np.zeros_like(rates) if accelerations is None else accelerations[1:].copy()
        rates[:, entries], second_rates[:, entries] = rotations.rotation_vector_rates(
            ends[:, entries], rates[:, entries], second_rates[:, entries]
        )
        conditions += [durations * velocities[:-1], durations * rates]
        table = _CUBIC
        if accelerations is not None:
            squares = durations * durations
            conditions += [squares * accelerations[:-1], squares * second_rates]
            table = QUINTIC
    coefficients = np.zeros((len(ends), _DEGREE, layout.size))
    coefficients[:, : len(table)] = fixed_order.product(table, np.stack(conditions, axis=1))
    return coefficients
