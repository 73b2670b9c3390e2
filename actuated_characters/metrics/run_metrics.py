"""The figures of a run, measured from what went over the topics."""

import hashlib
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointType
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.state import StampedReference, StampedState

_BLOCK = 256  # ticks that are evaluated together: a few array operations for all of them
_FALL_FRACTION = 0.5  # of the reference's root height
_LEAST_HEIGHT = 0.5  # m; a reference below lies on the ground of its own will
_AT_LIMIT = 1.0 - 1e-9

COLUMNS = (
    "time_s",
    "joint_error_mean_rad",
    "joint_error_max_rad",
    "root_error_m",
    "root_height_m",
    "reference_root_height_m",
    "assist_force_n",
    "effort_of_limit_max",
)


@dataclass(frozen=True)
class Tick:
    """One tick: a state, the next one with the effort that led there, and the state's reference."""

    state: StampedState
    following: StampedState
    reference: StampedReference | None


class StateHash:
    """A hash over every tick's state, its doubles bit for bit."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, state: StampedState) -> None:
        """Add a state: stamp, position and velocity."""
        self._hash.update(state.stamp_ns.to_bytes(8, "little", signed=True))
        self._hash.update(state.position.tobytes())
        self._hash.update(state.velocity.tobytes())

    def hexdigest(self) -> str:
        """The hash of all states so far, hexadecimal."""
        return self._hash.hexdigest()


class Measurement:
    """Takes a run tick by tick; gives its figures and its series at the end."""

    def __init__(self, configuration: RunConfiguration) -> None:
        self._configuration = configuration
        self._layout = configuration.layout
        self._hash = StateHash()
        self._block: list[Tick] = []
        self._rows: list[FloatArray] = []
        self._saturated = 0
        self._first_stamp: int | None = None
        self._last_stamp = 0
        self._ticks = 0
        owners = [joint.type for joint in self._layout.joints for _ in joint.vectors]
        self._rotates = np.array(
            [owner in (JointType.REVOLUTE, JointType.SPHERICAL) for owner in owners], dtype=np.bool_
        )
        self._actuated: BoolArray = np.array(
            [owner is not JointType.FLOATING for owner in owners], dtype=np.bool_
        )

    def add_state(self, state: StampedState) -> None:
        """Take a state into the hash; each once, in order."""
        self._hash.add(state)
        if self._first_stamp is None:
            self._first_stamp = state.stamp_ns
        self._last_stamp = state.stamp_ns

    def add_tick(self, tick: Tick) -> None:
        """Take a tick that is over; in order."""
        self._ticks += 1
        self._block.append(tick)
        if len(self._block) == _BLOCK:
            self._evaluate()

    @property
    def state_hash(self) -> str:
        """The hash over all states so far."""
        return self._hash.hexdigest()

    def series(self) -> FloatArray:
        """One row a tick, of `COLUMNS`; NaN where there was no reference."""
        self._evaluate()
        return np.vstack([np.empty((0, len(COLUMNS))), *self._rows])

    def summary(self, wall_time: float) -> dict[str, object]:
        """The figures by name; `wall_time` in s is what the ticks took. None: not measurable."""
        columns = dict(zip(COLUMNS, self.series().T, strict=True))
        sim_time = (self._last_stamp - (self._first_stamp or 0)) / NANOSECONDS_PER_SECOND
        vectors = self._ticks * int(self._actuated.sum())
        parameters = self._configuration.parameters
        gravity = float(parameters.get("gravity", np.nan))
        actuated = self._layout.mask(parameters.get("commanded_joints", ()))
        return {
            "ticks": self._ticks,
            "sim_time_s": sim_time,
            "wall_time_s": wall_time,
            "real_time_factor": sim_time / wall_time if wall_time > 0.0 else None,
            "actuators": int(actuated.sum()),
            "degrees_of_freedom": self._layout.size,
            "fell": self._fell(columns),
            "joint_error_mean_rad": _mean(columns["joint_error_mean_rad"]),
            "root_error_mean_m": _mean(columns["root_error_m"]),
            "root_error_max_m": _maximum(columns["root_error_m"]),
            "assist_force_mean_n": _mean(columns["assist_force_n"]),
            "body_weight_n": self._configuration.mass * gravity,
            "saturated_fraction": self._saturated / vectors if vectors else None,
            "state_hash": self.state_hash,
        }

    def _fell(self, columns: dict[str, FloatArray]) -> bool | None:
        height, desired = columns["root_height_m"], columns["reference_root_height_m"]
        if np.isnan(desired).all():
            return None
        stands = desired > _LEAST_HEIGHT  # false where it is NaN
        return bool(np.any(stands & (height < _FALL_FRACTION * desired)))

    def _evaluate(self) -> None:
        """Evaluate the ticks that were collected."""
        block, self._block = self._block, []
        if not block:
            return
        missing = np.full(self._layout.size, np.nan)
        position = np.stack([tick.state.position for tick in block])
        desired = np.stack(
            [missing if tick.reference is None else tick.reference.position for tick in block]
        )
        applied = np.stack(
            [tick.following.effort for tick in block if tick.following.effort is not None]
        )
        stamps = np.array([tick.state.stamp_ns - (self._first_stamp or 0) for tick in block])
        rows = np.full((len(block), len(COLUMNS)), np.nan)
        rows[:, 0] = stamps / NANOSECONDS_PER_SECOND
        self._measure_errors(rows, position, desired)
        self._measure_efforts(rows, applied)
        self._rows.append(rows)

    def _measure_errors(self, rows: FloatArray, position: FloatArray, desired: FloatArray) -> None:
        layout = self._layout
        difference = layout.difference(
            layout.configuration(position), layout.configuration(desired)
        )
        errors = layout.norms(difference)
        if self._rotates.any():
            rows[:, 1] = errors[:, self._rotates].mean(axis=1)
            rows[:, 2] = errors[:, self._rotates].max(axis=1)
        if layout.has_floating_base:
            rows[:, 3], rows[:, 4], rows[:, 5] = errors[:, 0], position[:, 2], desired[:, 2]

    def _measure_efforts(self, rows: FloatArray, applied: FloatArray) -> None:
        norms = self._layout.norms(applied)
        if self._layout.has_floating_base:
            rows[:, 6] = norms[:, 0]
        limits = self._configuration.effort_limits[self._actuated]
        of_limit = np.divide(
            norms[:, self._actuated],
            limits,
            out=np.ones((len(rows), len(limits))),
            where=limits > 0.0,
        )
        rows[:, 7] = of_limit.max(axis=1, initial=0.0)
        self._saturated += int((of_limit >= _AT_LIMIT).sum())


def _mean(values: FloatArray) -> float | None:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None


def _maximum(values: FloatArray) -> float | None:
    known = values[~np.isnan(values)]
    return float(known.max()) if len(known) else None
