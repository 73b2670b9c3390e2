"""Layers of a timeline: some joints follow a path of their own, over all that is beneath."""

from dataclasses import dataclass

import numpy as np

from controller_node.references.base import Reference, ReferenceState
from controller_node.references.curve import Curve, Knots, from_and_to_rest, smooth_knots
from controller_node.references.inertialised import InertializationOffset
from controller_node.references.limits import JointLimits
from controller_node.references.timeline.description import Ease, Layer, Pose
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import LayoutError, MotionError


@dataclass(frozen=True)
class Span:
    """When a layer is in force; times in s."""

    first: float  # it is where it wants to be from here on
    last: float  # to here
    come: float  # before the first, in which it comes from what is beneath
    go: float | None  # after the last, in which it gives way; None: it stays


class LayeredReference:
    """A path of some degrees of freedom over another reference.

    It comes and goes without a jump of position, velocity or acceleration. A layer that would come
    before time 0 is there from the beginning.
    """

    def __init__(
        self, layout: JointLayout, beneath: Reference, path: Curve, driven: IntArray, span: Span
    ) -> None:
        """`driven` (m,) are the degrees of freedom that follow the path."""
        self._beneath, self._path, self._driven = beneath, path, driven
        self._turns = np.flatnonzero(np.isin(layout.rotation_entries[:, 0], driven))
        self._begin = max(span.first - span.come, 0.0)
        self._last, self._end = span.last, np.inf if span.go is None else span.last + span.go
        self._coming = self._going = None
        if self._begin > 0.0 and span.come > 0.0:
            wanted, own = beneath.sample(self._begin), self._posed(self._begin)
            self._coming = InertializationOffset(layout, own, wanted, self._begin, span.come)
        if span.go:
            wanted, own = self._posed(span.last), beneath.sample(span.last)
            self._going = InertializationOffset(layout, own, wanted, span.last, span.go)

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        if time < self._begin or time >= self._end:
            return self._beneath.sample(time)
        if time > self._last and self._going is not None:
            return self._going.applied(self._beneath.sample(time), time)
        posed = self._posed(time)
        return posed if self._coming is None else self._coming.applied(posed, time)

    def _posed(self, time: float) -> ReferenceState:
        """What is beneath, with the path's degrees of freedom."""
        own, beneath = self._path.sample(time), self._beneath.sample(time)
        driven, turns = self._driven, self._turns

        def merged(lower: FloatArray, upper: FloatArray, rows: IntArray) -> FloatArray:
            result = lower.copy()
            result[rows] = upper[rows]
            return result

        configuration = GeneralizedPosition(
            merged(beneath.configuration.position, own.configuration.position, driven),
            merged(
                beneath.configuration.orientations_xyzw, own.configuration.orientations_xyzw, turns
            ),
        )
        return ReferenceState(
            configuration,
            merged(beneath.velocity, own.velocity, driven),
            merged(beneath.acceleration, own.acceleration, driven),
        )


def layer_of_poses(character: Character, beneath: Reference, layer: Layer) -> LayeredReference:
    """The layer of some poses. Raises MotionError if the character cannot take one of them."""
    layout = character.layout
    driven, rows = _driven(layout, layer), _rows(character, layer)
    times = np.array([pose.at for pose in layer.poses])
    knots = Knots(times, layout.configuration(rows))
    rates = [_rates(layout, layer, driven, key) for key in ("velocity", "acceleration")]
    if len(times) > 1 or any(each is not None for each in rates):
        knots = smooth_knots(layout, times, knots.configurations, *rates, loops=False)
        rests = [pose.ease is Ease.REST for pose in layer.poses]
        for each in (knots.velocities, knots.accelerations):
            assert each is not None
            each[rests] = 0.0
        knots = from_and_to_rest(knots)
    path = Curve(layout, knots)
    span = Span(layer.poses[0].at, layer.poses[-1].at, layer.come, layer.go)
    return LayeredReference(layout, beneath, path, driven, span)


def _driven(layout: JointLayout, layer: Layer) -> IntArray:
    """The degrees of freedom (m,) that the poses of a layer name."""
    found: set[int] = set()
    for pose in layer.poses:
        try:
            found.update(layout.indices(tuple(pose.values)).tolist())
        except LayoutError as error:
            raise MotionError(f"{pose.place}: pose: {error}") from error
    return np.array(sorted(found), dtype=np.intp)


def _rates(layout: JointLayout, layer: Layer, driven: IntArray, key: str) -> FloatArray | None:
    """The velocities, or accelerations, (p, n) of the poses, NaN for none; None without any."""
    rows = np.full((len(layer.poses), layout.size), np.nan)
    for pose, row in zip(layer.poses, rows, strict=True):
        rates = pose.velocity if key == "velocity" else pose.acceleration
        try:
            entries = layout.indices(tuple(rates))
        except LayoutError as error:
            raise MotionError(f"{pose.place}: {key}: {error}") from error
        for name, entry in zip(rates, entries.tolist(), strict=True):
            if entry not in driven:
                raise MotionError(f"{pose.place}: {key}: no pose of the layer has '{name}'")
        row[entries] = list(rates.values())
    return rows if not np.isnan(rows).all() else None


def _rows(character: Character, layer: Layer) -> FloatArray:
    """The positions (p, n) of a layer's poses; what is not named has its nearest earlier value.

    What no earlier pose names has the value of the first one that does.
    """
    index_of = {name: index for index, name in enumerate(character.layout.dof_names)}
    row, limits = np.array(character.rest_position), JointLimits(character)
    for pose in reversed(layer.poses):
        _set(row, index_of, pose)
    rows = []
    for pose in layer.poses:
        _set(row, index_of, pose)
        excess = limits.excess(row)
        for name, value in pose.values.items():
            if excess[index_of[name]] > 0.0:
                right = f"within the joint's limits, {limits.text(index_of[name])}"
                raise MotionError(f"{pose.place}: pose.{name} is {value:g}; it must be {right}")
        rows.append(row.copy())
    return np.array(rows)


def _set(row: FloatArray, index_of: dict[str, int], pose: Pose) -> None:
    for name, value in pose.values.items():
        row[index_of[name]] = value
