"""The references that a policy is trained on, tick by tick, and as it is told of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.training.episode_types import Table
from actuated_characters.training.starts import StartRange
from controller_node.planner.compiled.features import FeatureLayout
from controller_node.planner.compiled.observation import (
    ObservationScales,
    heading,
    observe,
    write_frame,
)
from controller_node.planner.compiled.rollout import RolloutModel, features_of
from controller_node.planner.contact_model import ContactModel
from controller_node.tracked_reference import TrackedReference
from msgs_config.arrays import FloatArray, IntArray

_AHEAD_S = (0.0, 0.1, 0.3)  # how far the frames that a policy is told of are ahead
_AFTER_S = 1.0  # how long an episode goes on after a clip that does not wrap
_WRAPPED_S = 20.0  # length, at least, of an episode of a clip that wraps
_DEVIATIONS = (0.2, 0.3, 1.5, 4.0, 0.12, 0.5, 4.0, 0.15)  # scales, in the order of features
_LEAST_SPREADS = (0.1, 0.3, 0.1, 0.1, 0.05, 0.1)  # of frames' parts that hardly vary
_WIDE = 4.0  # spreads that count as one: entries of a frame vary together


@dataclass(frozen=True)
class TrainedReference:
    """A reference, and where its episodes may begin."""

    reference: TrackedReference  # as a controller would track it
    cycle_s: float  # until which they may begin
    wraps: bool  # whether it goes on from its end
    lasts_s: float = 0.0  # until which it goes on, if that is longer
    weight: float = 1.0  # how many episodes begin in it, against others


def frames_ahead(rate_hz: int) -> IntArray:
    """Ticks (k,) from now to the frames that a policy is told of."""
    return np.array([round(each * rate_hz) for each in _AHEAD_S], dtype=np.intp)


def make_table(
    model: ContactModel, body: RolloutModel, references: Sequence[TrainedReference], rate_hz: int
) -> tuple[Table, list[StartRange]]:
    """References as one table, and of each the rows in which episodes may begin."""
    ahead = frames_ahead(rate_hz)
    parts, starts, first = list[tuple[FloatArray, ...]](), list[StartRange](), 0
    for each in references:
        seconds = max(each.cycle_s, each.lasts_s) + _AFTER_S
        if each.wraps:
            seconds = max(seconds, _WRAPPED_S)
        count = round(seconds * rate_hz) + int(ahead[-1]) + 2
        parts.append(_sample(model, body, each.reference, count))
        begins = max(round(each.cycle_s * rate_hz), 1)
        starts.append(StartRange(first, begins, each.wraps, each.weight))
        first += count
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    lasts = np.cumsum([len(part[0]) for part in parts]) - 1
    ends = np.repeat(lasts, [len(part[0]) for part in parts]).astype(np.intp)
    positions, velocities, features, frames, facing = columns
    return Table(positions, velocities, features, frames, facing, ends, ahead), starts


def _sample(
    model: ContactModel, body: RolloutModel, reference: TrackedReference, count: int
) -> tuple[FloatArray, ...]:
    engine = model.engine()
    states = [reference.desired_at(tick) for tick in range(count)]
    positions = np.array([model.position_of(state.configuration.position) for state in states])
    velocities = np.array([state.velocity for state in states])
    layout = model.feature_layout
    features = np.zeros((count, layout.size))
    frames = np.zeros((count, layout.frame_size))
    for tick, state in enumerate(states):
        features_of(features[tick], positions[tick], velocities[tick], body, engine)
        joints = state.configuration.position[6:].copy()
        write_frame(frames[tick], positions[tick], joints, features[tick], layout.centre)
    facing = np.array([heading(position, model.left) for position in positions])
    return positions, velocities, features, frames, facing


def make_scales(
    table: Table, starts: Sequence[StartRange], layout: FeatureLayout
) -> ObservationScales:
    """Scales of observations: fixed for deviations, of frames by how they vary."""
    centre, deviation = layout.centre, np.repeat(_DEVIATIONS, layout.sizes)
    shape = (len(table.ahead), table.frames.shape[1])
    plain = ObservationScales(deviation, np.zeros(shape), np.ones(shape), centre)
    told = np.array([_told(table, int(row), plain) for each in starts for row in each.rows])
    least = np.repeat(_LEAST_SPREADS, layout.frame_sizes)
    spread = _WIDE * np.maximum(told.std(axis=0), least)
    return ObservationScales(deviation, told.mean(axis=0), spread, centre)


def _told(table: Table, row: int, scales: ObservationScales) -> FloatArray:
    """Frames (k, d) as a policy is told of them at a row."""
    rows = np.minimum(row + table.ahead, table.ends[row])
    observation = np.zeros(len(scales.deviation) + scales.frame_mean.size, np.float32)
    nothing = np.zeros(len(scales.deviation))
    observe(observation, nothing, table.frames[rows], table.facing[row], scales)
    found = observation[len(scales.deviation) :].astype(float)
    return found.reshape(scales.frame_mean.shape)
