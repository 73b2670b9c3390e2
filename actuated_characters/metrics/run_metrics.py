"""The figures of a run, measured tick by tick."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from actuated_characters.metrics.error_measures import (
    AT_LIMIT,
    distances,
    effort_sizes,
    follows_state,
    limit_shares,
    vector_kinds,
)
from actuated_characters.metrics.falls import PostureReader, fall_row, is_down, tilts
from actuated_characters.metrics.state_hash import StateHash
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointType
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.shared_parameters import NO_GROUND

Series: TypeAlias = dict[str, FloatArray]
"""A column (t,) of one entry a tick, by its name."""

COLUMNS = (
    "time_s",
    "joint_error_mean_rad",
    "joint_error_max_rad",
    "root_error_m",
    "root_height_m",
    "reference_root_height_m",
    "assist_force_n",
    "effort_of_limit_max",
    "centre_height_m",
    "tilt_rad",
    "is_down",
)
"""Of every character's series; those of sliders follow, see `slider_columns`."""

_BLOCK = 256  # ticks that are evaluated together: a few array operations for all of them


def slider_columns(slider: str) -> tuple[str, str, str]:
    """Names of the columns of a slider: position in m, its reference, and effort in N."""
    return f"position.{slider}", f"reference_position.{slider}", f"effort.{slider}"


@dataclass(frozen=True)
class Tick:
    """One tick: a state, the next one with the effort that led there, and the state's reference."""

    state: StampedState
    following: StampedState
    reference: StampedReference | None


class Measurement:
    """Measures a run tick by tick; gives its figures and its series at the end."""

    def __init__(
        self, configuration: RunConfiguration, postures: PostureReader | None = None
    ) -> None:
        """Without a reader of postures whether the character fell is not known."""
        self._configuration = configuration
        self._postures = postures
        self._modes: list[tuple[int, str]] = []  # stamps, ns, and the modes in force since then
        self._before: FloatArray | None = None  # position in the tick before
        self._has_one_weight = True
        self._layout = layout = configuration.layout
        self._hash = StateHash()
        self._block: list[Tick] = []
        self._rows: list[FloatArray] = []
        self._saturated = 0
        self._first_stamp: int | None = None
        self._last_stamp = 0
        self._ticks = 0
        self._kinds = vector_kinds(layout)
        self._sliders = [joint for joint in layout.joints if joint.type is JointType.PRISMATIC]
        # Whether the reference of each vector followed the state in the tick before.
        self._followed = np.zeros(len(self._kinds.units), dtype=np.bool_)
        self._columns = [*COLUMNS]
        for joint in self._sliders:
            self._columns += slider_columns(joint.name)

    def change(self, parameters: Mapping[str, Any]) -> None:
        """Go on with other parameters of the simulator; two gravities have no one weight."""
        if parameters.get("gravity") != self._configuration.parameters.get("gravity"):
            self._has_one_weight = False

    def add_mode(self, stamp_ns: int, mode: str) -> None:
        """Add the mode in which the controller is from a stamp on."""
        self._modes.append((stamp_ns, mode))

    def add_state(self, state: StampedState) -> None:
        """Add a state to the hash; each once, in order."""
        self._hash.add(state)
        if self._first_stamp is None:
            self._first_stamp = state.stamp_ns
        self._last_stamp = state.stamp_ns

    def add_tick(self, tick: Tick) -> None:
        """Add a tick that is over; in order."""
        self._ticks += 1
        self._block.append(tick)
        if len(self._block) == _BLOCK:
            self._evaluate()

    def add(self, tick: Tick) -> None:
        """Add the next tick of a run without gaps, and the states that it has besides."""
        if self._first_stamp is None:
            self.add_state(tick.state)
        self.add_state(tick.following)
        self.add_tick(tick)

    @property
    def state_hash(self) -> str:
        """The hash over all states so far."""
        return self._hash.hexdigest()

    def series(self) -> Series:
        """The columns of `COLUMNS` and those of sliders; NaN where nothing can be measured."""
        self._evaluate()
        rows = np.vstack([np.empty((0, len(self._columns))), *self._rows])
        return dict(zip(self._columns, rows.T, strict=True))

    def _weight(self) -> float | None:
        """The weight, N; None where gravity was changed."""
        if not self._has_one_weight:
            return None
        gravity = float(self._configuration.parameters.get("gravity", np.nan))
        return self._configuration.mass * gravity

    def summary(self, wall_time: float | None) -> dict[str, object]:
        """The figures by name, None if not measurable; `wall_time` is that of all ticks, s."""
        series, layout = self.series(), self._layout
        sim_time = (self._last_stamp - (self._first_stamp or 0)) / NANOSECONDS_PER_SECOND
        vectors = self._ticks * int(self._kinds.actuated.sum())
        parameters = self._configuration.parameters
        commanded = layout.mask(parameters.get("commanded_joints", ()))
        of_root = commanded[layout.joints[0].entries] if layout.has_floating_base else np.zeros(0)
        return {
            "ticks": self._ticks,
            "sim_time_s": sim_time,
            "wall_time_s": wall_time,
            "real_time_factor": sim_time / wall_time if wall_time and wall_time > 0.0 else None,
            "actuators": int(commanded.sum()),
            "root_actuators": int(of_root.sum()),
            "degrees_of_freedom": layout.size,
            **self._describe_fall(series),
            "joint_error_mean_rad": _of_known(np.mean, series["joint_error_mean_rad"]),
            "slider_error_mean_m": _of_known(np.mean, self._slider_errors(series)),
            "slider_error_max_m": _of_known(np.max, self._slider_errors(series)),
            "root_error_mean_m": _of_known(np.mean, series["root_error_m"]),
            "root_error_max_m": _of_known(np.max, series["root_error_m"]),
            "assist_force_mean_n": _of_known(np.mean, series["assist_force_n"]),
            "body_weight_n": self._weight(),
            "saturated_fraction": self._saturated / vectors if vectors else None,
            "state_hash": self.state_hash,
        }

    def _describe_fall(self, series: Series) -> dict[str, object]:
        """Whether and when the character fell, and in which mode of the controller."""
        fell: dict[str, object] = dict.fromkeys(("fell", "fell_at_s", "fell_in_mode"))
        parameters = self._configuration.parameters
        can_fall = parameters.get("gravity", 1.0) and parameters.get("terrain") != NO_GROUND
        if self._postures is None or not can_fall:
            return fell
        rate = float(parameters["rate"])
        row = fall_row(series["is_down"] == 1.0, np.rint(series["time_s"] * rate), rate)
        fell["fell"] = row is not None
        if row is not None:
            time = float(series["time_s"][row])
            before = (self._first_stamp or 0) + (time - 1.0 / rate) * NANOSECONDS_PER_SECOND
            modes = [mode for stamp, mode in self._modes if stamp <= before + 1.0]
            fell |= {"fell_at_s": time, "fell_in_mode": modes[-1] if modes else None}
        return fell

    def has_fallen(self) -> bool:
        """Whether the character has fallen so far; False where that is not known."""
        return bool(self._describe_fall(self.series())["fell"])

    def _slider_errors(self, series: Series) -> FloatArray:
        """Distance of each slider from its reference in each tick, m."""
        names = [slider_columns(joint.name) for joint in self._sliders]
        pairs = [series[position] - series[reference] for position, reference, _ in names]
        return np.abs(np.array(pairs))

    def _follows(self, position: FloatArray, errors: FloatArray, begins: BoolArray) -> BoolArray:
        """Where (r, b) the reference of the next r ticks follows the state; see `follows_state`."""
        before = np.vstack([position[:1] if self._before is None else self._before, position[:-1]])
        self._before = position[-1:]
        moved = distances(self._layout, before, position)
        follows = follows_state(errors, moved, self._followed, begins)
        self._followed = follows[-1]
        return follows

    def _measure_posture(
        self, position: FloatArray, desired: FloatArray, columns: Mapping[str, FloatArray]
    ) -> None:
        """Measure how high and upright positions (r, n) are, against desired ones or NaN."""
        if self._postures is None:
            return
        body, wanted = self._postures.read(position), self._postures.read(desired)
        columns["centre_height_m"][:] = body.height
        columns["tilt_rad"][:] = tilts(body.up, wanted.up)
        columns["is_down"][:] = is_down(body, wanted, self._postures.standing_height)

    def _evaluate(self) -> None:
        """Evaluate the ticks that were collected."""
        block, self._block = self._block, []
        if not block:
            return
        missing = np.full(self._layout.size, np.nan)
        position = np.stack([tick.state.position for tick in block])
        desired = np.stack(
            [missing if t.reference is None else t.reference.position for t in block]
        )
        applied = np.stack([t.following.effort for t in block if t.following.effort is not None])
        stamps = np.array([tick.state.stamp_ns - (self._first_stamp or 0) for tick in block])
        rows = np.full((len(block), len(self._columns)), np.nan)
        columns = dict(zip(self._columns, rows.T, strict=True))
        columns["time_s"][:] = stamps / NANOSECONDS_PER_SECOND
        errors = distances(self._layout, position, desired)
        begins = np.array([tick.state.effort is None for tick in block], dtype=np.bool_)
        follows = self._follows(position, errors, begins)
        errors[follows] = np.nan  # a reference that is made of the state tells no error
        if self._kinds.rotating.any():
            columns["joint_error_mean_rad"][:] = _rows(np.mean, errors[:, self._kinds.rotating])
            columns["joint_error_max_rad"][:] = _rows(np.max, errors[:, self._kinds.rotating])
        sizes = effort_sizes(self._layout, applied)
        if self._layout.has_floating_base:
            columns["root_error_m"][:] = errors[:, 0]
            columns["root_height_m"][:] = position[:, 2]
            columns["reference_root_height_m"][:] = desired[:, 2]
            columns["assist_force_n"][:] = sizes[:, 0]
            self._measure_posture(position, np.where(follows[:, :1], np.nan, desired), columns)
        for joint in self._sliders:
            given = (position, desired, applied)
            for name, values in zip(slider_columns(joint.name), given, strict=True):
                columns[name][:] = values[:, joint.start]
        limits = self._configuration.effort_limits[self._kinds.actuated]
        shares = limit_shares(sizes[:, self._kinds.actuated], limits)
        columns["effort_of_limit_max"][:] = shares.max(axis=1, initial=0.0)
        self._saturated += int((shares >= AT_LIMIT).sum())
        self._rows.append(rows)


def _rows(measure: Callable[..., Any], values: FloatArray) -> FloatArray:
    """Mean or maximum of each row (r, b), NaN left out; NaN of a row without a number."""
    measured: FloatArray = measure(values, axis=1)
    for row in np.flatnonzero(np.isnan(measured)).tolist():
        known = values[row][~np.isnan(values[row])]
        measured[row] = measure(known) if len(known) else np.nan
    return measured


def _of_known(measure: Callable[[FloatArray], float], values: FloatArray) -> float | None:
    """Mean or maximum of a series, NaN left out; None without a number."""
    known = values[~np.isnan(values)]
    return float(measure(known)) if len(known) else None
