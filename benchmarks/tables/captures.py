"""Files of ten makers imported as clips, and how well they are tracked; or other BVH files."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from actuated_characters.metrics.error_measures import joint_errors
from benchmarks.tables.case import Case, Fact
from benchmarks.tables.many import Options, RunTable
from benchmarks.tables.planned import planner
from benchmarks.tables.seen import Seen
from character_motion.clips.importing import ImportedClip, import_bvh
from character_motion.retargeting.target_body import TargetBody
from msgs_config.character.loading import load_character
from tests.support.capture_makers import MAKERS, TEN_FILES
from tests.support.captures import capture

MADE = {f"{maker}_{clip}": (maker, clip) for maker, clip in TEN_FILES}


def capture_cases(kind: str, options: Options) -> Iterator[Case]:
    """A clip of a file, with root assistance and by joint torques alone, planned."""
    if kind in MADE:
        maker, clip = MADE[kind]
        file = capture(options.folder / f"{kind}.bvh", MAKERS[maker], clip)
    else:
        file = Path(kind)
    made = import_bvh(file, TargetBody(load_character("humanoid")))
    path = options.folder / f"{file.stem}.json"
    made.clip.write(path)
    motion, seconds = {"reference": "clip", "clip": str(path)}, float(made.clip.times[-1])
    yield Case(f"{file.stem}, assisted", seconds, motion, facts=_quality(made), follows=True)
    for seed in options.seeds(1):
        controller = planner(seed)
        yield Case(f"{file.stem}, planned", seconds, motion, controller=controller, follows=True)


def _quality(made: ImportedClip) -> dict[str, Fact]:
    quality, conventions = made.quality, made.retargeted.conventions
    skating = [
        "-" if value is None else f"{100 * value:.2f}"
        for value in (quality.skating_mean_m_s, quality.skating_p95_m_s)
    ]
    return {
        "up, unit, rest": f"{conventions.up}, {conventions.unit}, {conventions.rest}",
        "in ground, mm": 1e3 * max(quality.feet_in_ground_m, 0.0),
        "skating; 95 % below, cm/s": "; ".join(skating),
        "worst joint, rad": f"{made.worst_joint} {made.worst_mean_rad:.2f}",
    }


def measure_capture(seen: Seen) -> Mapping[str, Fact]:
    """How well a clip is tracked."""
    joints = joint_errors(seen.plan.character.layout, seen.position, seen.desired)
    return {"joints, rad": float(np.mean(joints)), "to the end": seen.lost_at is None}


TABLES: Mapping[str, RunTable] = {
    "captures": RunTable(
        "clips of captures", [*MADE], capture_cases, measure_capture, takes_files=True
    )
}
