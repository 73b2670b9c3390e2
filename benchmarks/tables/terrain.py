"""Walks over terrain: stairs and slopes that the planner sees, and steps that nobody does."""

from collections.abc import Iterator

import numpy as np
import yaml

from benchmarks.tables.case import Case, Fact
from benchmarks.tables.machines import STEP_LENGTH, steps_urdf
from benchmarks.tables.many import Options, RunTable
from benchmarks.tables.planned import planner
from benchmarks.tables.seen import Seen

RISE, STEPS, ANGLE = 0.15, 4, 15.0  # m, of stairs; degrees, of slopes
BLIND_STEP, BLIND_STEPS = 0.05, 5  # m up or down, every 0.8 m
BLIND_SPEED = 0.5  # m/s
MACHINE_PACE = 0.8  # of the commanded speed, at least, over steps
BEYOND = 0.8  # m that it goes on for


def terrain_cases(kind: str, options: Options) -> Iterator[Case]:
    """Walks straight ahead, each at another speed, and over another place of the terrain."""
    for seed in options.seeds(24):
        rng = np.random.default_rng((seed, len(kind)))
        begin, speed = (round(float(rng.uniform(*each)), 3) for each in ((1.5, 2.5), (0.5, 0.65)))
        is_seen = kind in ("stairs", "slopes")
        ground = options.folder / f"{kind}_{seed}.{'yaml' if is_seen else 'urdf'}"
        controller = planner(seed) | {"plan.step": 0.009}
        if kind == "slopes":  # the default foresees slips there: 15 degrees take 0.27 by themselves
            controller |= {"plan.friction": 0.45}
        if kind == "machine":
            controller = {"behaviour": "state_machine", "machine": options.machine or "rough"}
        if not is_seen:
            heights = np.cumsum(BLIND_STEP * rng.choice((-1.0, 1.0), BLIND_STEPS)).tolist()
            ground.write_text(steps_urdf(heights, begin))
            end, speed = begin + STEP_LENGTH * (BLIND_STEPS - 1), BLIND_SPEED
            if kind == "blind":
                controller |= {"terrain": "felt"}
        else:
            tread = round(float(rng.uniform(0.35, 0.45)), 3)
            piece: dict[str, object] = {"at": [begin, 0.0], "width": 4.0, "landing": 1.5}
            piece |= (
                {"steps": STEPS, "rise": RISE, "tread": tread}
                if kind == "stairs"
                else {"angle": ANGLE, "length": 2.5}
            )
            ground.write_text(yaml.safe_dump({kind: [{**piece, "down": True}]}))
            end = begin + (2 * STEPS * tread + 1.5 - tread if kind == "stairs" else 6.5)
        pace = MACHINE_PACE * speed if kind == "machine" else speed
        yield Case(
            kind,
            options.seconds or round((end + BEYOND) / pace + 1.0, 2),
            {} if kind == "machine" else {"reference": "steered"},
            {"terrain": str(ground)},
            controller,
            commands=f"{speed},0,0@0.5",
            facts={"speed, m/s": speed, "end, m": end},
        )


def measure_terrain(seen: Seen) -> dict[str, Fact]:
    """Whether it walked to the end of the terrain, and where it fell."""
    x, z = (float(seen.position[-1, axis]) for axis in (0, 2))
    fell = seen.fell_at is not None
    return {
        "upright at the end": not fell and x > float(seen.case.facts["end, m"] or 0.0),
        "height at the end, m": None if fell else z,
        "fell at, m": f"{x:.2f}" if fell else None,
    }


TABLES = {
    "terrain": RunTable(
        f"terrain, planned: stairs of {RISE:g} m, slopes of {ANGLE:g} degrees, unseen steps of "
        f"{BLIND_STEP:g} m; these by a machine as well",
        ["stairs", "slopes", "blind", "machine"],
        terrain_cases,
        measure_terrain,
    )
}
