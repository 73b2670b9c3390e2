"""How deep clips sink into the ground, with root assistance; and how well they are tracked."""

from collections.abc import Iterator, Mapping

import numpy as np

from actuated_characters.metrics.error_measures import joint_errors
from benchmarks.tables.case import Case, Fact
from benchmarks.tables.many import Options, RunTable
from benchmarks.tables.seen import Seen
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Character
from msgs_config.clips.reading import available_clips
from sim_node.physics.engine import ENGINES

_SECONDS = 4.0


def ground_cases(clip: str, options: Options) -> Iterator[Case]:
    """A clip on each engine."""
    motion, seconds = {"reference": "clip", "clip": clip}, options.seconds or _SECONDS
    for engine in ENGINES:
        world = {"engine": engine}
        yield Case(f"{clip}, {engine}", seconds, motion, world, until_fall=False)


def measure_ground(seen: Seen) -> Mapping[str, Fact]:
    """Depths in mm over ticks, and the mean error of the joints."""
    character = seen.plan.character
    facts: dict[str, Fact] = {}
    for name, positions in (("", seen.position), ("reference's ", seen.desired)):
        depths = 1e3 * depths_below_ground(character, positions)
        facts[f"{name}depth, mm"] = float(depths.mean())
        facts[f"{name}95 of 100"] = float(np.percentile(depths, 95))
        facts[f"{name}most"] = float(depths.max())
    joints = joint_errors(character.layout, seen.position, seen.desired)
    return {**facts, "joints, rad": float(joints.mean())}


def depths_below_ground(character: Character, positions: FloatArray) -> FloatArray:
    """How far (r,) a character's lowest point is below z = 0 at positions (r, n), m; 0 above."""
    model, still = DynamicsModel(character), np.zeros(character.layout.size)
    depths = np.zeros(len(positions))
    for row, position in enumerate(positions):
        model.update(position, still)
        depths[row] = max(-float(lowest_heights(character, model).min()), 0.0)
    return depths


TABLES: Mapping[str, RunTable] = {
    "ground": RunTable(
        "depth of clips in the ground",
        available_clips(load_character("humanoid")),
        ground_cases,
        measure_ground,
    )
}
