"""Planned motion: clips, walks that are pushed, and courses, by joint torques alone."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from actuated_characters.metrics.error_measures import joint_errors
from actuated_characters.runs.planned.throws import plan_throws
from actuated_characters.training.exercises import random_drive
from benchmarks.tables.case import Case, Fact
from benchmarks.tables.many import Options, RunTable
from benchmarks.tables.seen import Seen
from controller_node.references.steering.velocity import SteeringLimits
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.clips.reading import available_clips, read_clip
from msgs_config.geometry import rotations

CYCLE = 1.27  # s, of the walk
BALL_SPEED = 8.0  # m/s
BALL_LIFETIME = 0.6  # s, of which it flies 0.2
MISSED = 0.2  # m that a walk is beside its clip where a ball misses it
EIGHT = "1,0,0.4@1 1,0,-0.4@16.7 2.2,0,0.7@32.4 2.2,0,-0.7@41.4 0,0,0@50.4"
STOP = "2.5,0,0@0 0,0,0@5.5"
ZIG_ZAG_SPEEDS, ZIG_ZAG_TURNS = (0.4, 2.2), (0.3, 1.0)  # m/s, rad/s
ZIG_ZAG_LASTS, SHARPEST = (1.0, 3.0), 1.5  # s, m/s^2 to the side
JOLT, JOLT_LASTS = 5.0, 0.2  # N s, s
_TIME = re.compile(r"(?:@|at=)([0-9.]+)")  # time of a push or a throw
STANDS, OVER = 0.15, 0.25  # m/s, s: it stands if it is slower than this in the mean over that time


def planner(seed: int) -> dict[str, object]:
    """Parameters of the controller that plans, with a seed, in the process of its world."""
    return {"planner": "predictive", "plan.seed": seed, "plan.workers": 1}


# Clips


def clip_cases(clip: str, options: Options) -> Iterator[Case]:
    """A cycle of a clip, or so many seconds, with each seed."""
    cycle = float(read_clip(load_character("humanoid"), clip).times[-1])
    motion = {"reference": "clip", "clip": clip}
    for seed in options.seeds(5):
        seconds = options.seconds or cycle
        yield Case(clip, seconds, motion, controller=planner(seed), follows=True)


def measure_clip(seen: Seen) -> dict[str, Fact]:
    """Errors, means over ticks, of the root also those of height and tilt; whether it was lost."""
    here, there = seen.centres(seen.position), seen.centres(seen.desired)
    joints = joint_errors(seen.plan.character.layout, seen.position, seen.desired)
    roots = seen.position[:, :6], seen.desired[:, :6]
    place = roots[0][:, :3] - roots[1][:, :3]
    up, wanted = (
        rotations.rotate(rotations.conjugate(rotations.exp(root[:, 3:])), np.array((0.0, 0.0, 1.0)))
        for root in roots
    )
    tilts = np.arctan2(np.linalg.norm(np.cross(up, wanted), axis=1), (up * wanted).sum(axis=1))
    return {
        "to the end": seen.lost_at is None,
        "centre of mass, m": float(np.linalg.norm(here - there, axis=1).mean()),
        "root, m": float(np.linalg.norm(place, axis=1).mean()),
        "height, m": float(np.abs(place[:, 2]).mean()),
        "tilt, rad": float(tilts.mean()),
        "joints, rad": float(joints.mean()),
        "lost at, s": None if seen.lost_at is None else f"{seen.lost_at:.2f}",
    }


# Pushes


@dataclass(frozen=True)
class PushKind:
    """How walks are pushed at the root."""

    forwards: float = 0.0  # N s
    sideways: float | None = None  # N s; None: as hard from any side
    hardest: float | None = None  # N s, up to which pushes differ; None: all are as hard
    pushes: int = 1
    every: float = 2.0  # s
    lasts: float = 0.2  # s that each push lasts
    balls: bool = False  # at the chest, of the impulse at BALL_SPEED; the clip heads forwards
    stands: bool = False  # it stands instead of walking
    seconds: float = 8.5
    behaviour: str = "tracking"


PUSH_KINDS = {
    "none": PushKind(pushes=0, seconds=20.0),
    "jolt": PushKind(5.0, seconds=60.0),
    "10 N s every 2 s": PushKind(10.0, pushes=9, lasts=0.1, seconds=20.0),
    "20 N s every 2 s": PushKind(20.0, pushes=9, lasts=0.1, seconds=20.0),
    "48 or 60 N s": PushKind(48.0, 60.0),
    "77 or 96 N s": PushKind(77.0, 96.0),
    "balls": PushKind(20.0, pushes=5, every=4.0, seconds=20.0, balls=True),
    "standing": PushKind(12.0, pushes=11, every=5.0, lasts=0.1, seconds=60.0, stands=True),
    "fall": PushKind(300.0, seconds=16.0, behaviour="active_ragdoll"),
    "drags": PushKind(300.0, lasts=1.0, seconds=16.0, behaviour="active_ragdoll"),
    "heavy balls": PushKind(120.0, balls=True, seconds=16.0, behaviour="active_ragdoll"),
    "any": PushKind(40.0, hardest=240.0, seconds=5.5),
}


def push_cases(name: str, options: Options) -> Iterator[Case]:
    """Walks that are pushed, each at other moments, from other sides, and with another seed."""
    kind = PUSH_KINDS[name]
    for seed in options.seeds(24):
        pushes = list(impulses(name, seed - 1))
        texts = [f"root:{x / kind.lasts!r},{y / kind.lasts!r},0@{time!r}" for time, x, y in pushes]
        balls = [_ball(*push) for push in pushes]
        yield Case(
            name,
            options.seconds or kind.seconds,
            {"reference": "hold"} if kind.stands else {"reference": "clip", "clip": "walk"},
            {"wrench_duration": kind.lasts, "ball_lifetime": BALL_LIFETIME},
            {**planner(seed), "behaviour": kind.behaviour},
            pushes=[] if kind.balls else texts,
            throws=balls if kind.balls else [],
            until_fall=kind.behaviour == "tracking",
        )


def _ball(time: float, x: float, y: float) -> str:
    """The throw of a ball of an impulse in N s that comes to the chest at a time in s."""
    mass, side = math.hypot(x, y) / BALL_SPEED, math.degrees(math.atan2(-y, -x))
    return f"mass={mass:.4g} speed={BALL_SPEED:g} target=chest at={time:.4f} from={side:.4f}"


def impulses(name: str, number: int) -> Iterator[tuple[float, float, float]]:
    """The pushes of a walk: time in s, impulse in N s forwards and to the left."""
    kind, draws = PUSH_KINDS[name], np.random.default_rng((number, len(name)))
    for push in range(kind.pushes):
        time = kind.every * push + 1.0 + draws.uniform(0.0, CYCLE)
        side = draws.uniform(-math.pi, math.pi)
        if kind.sideways is None:
            size = draws.uniform(kind.forwards, kind.hardest) if kind.hardest else kind.forwards
            impulse = size * math.cos(side), size * math.sin(side)
        else:
            sideways = math.copysign(kind.sideways, side)
            impulse = (kind.forwards, 0.0) if number % 2 else (0.0, sideways)
        yield float(time), *impulse


def measure_push(seen: Seen) -> dict[str, Fact]:
    """Whether it is on its feet; how far it is off the reference that gives way, second by second.

    A ball misses if the walk is so far beside its clip, across the ball's way, as it arrives.
    """
    here, there = seen.centres(seen.position), seen.centres(seen.desired)
    pairs = zip(seen.anchors, there, strict=True)
    placed = np.array([anchor.to_world(centre[np.newaxis])[0] for anchor, centre in pairs])
    errors = np.linalg.norm(here - placed, axis=1)
    kind, rate = PUSH_KINDS[seen.case.row], seen.rate
    times = [
        float(text) for text in _TIME.findall(" ".join((*seen.case.pushes, *seen.case.throws)))
    ]
    after: dict[str, Fact] = {}
    for second in range(4):
        starts = [round((time + kind.lasts + second) * rate) for time in times or [1.0]]
        looks = np.concatenate([errors[start : start + rate] for start in starts])
        after[f"off in second {second + 1}, m"] = float(np.median(looks)) if len(looks) else None
    missed = 0
    for time, ball in zip(times, plan_throws(seen.plan, seen.case.throws)[0], strict=False):
        row, (x, y, _) = round(time * rate), ball.throw.velocity
        if row < len(here):
            beside = here[row] - there[row]
            missed += abs(beside[0] * y - beside[1] * x) / math.hypot(x, y) > MISSED
    return {
        "upright": seen.is_up,
        "fell at, s": None if seen.fell_at is None else f"{seen.fell_at:.1f}",
        **after,
        "balls that missed": float(missed) if kind.balls else None,
    }


# Courses


def course_cases(kind: str, options: Options) -> Iterator[Case]:
    """A figure of eight, walked and then run, that ends in a stop; another stop; zig-zags; moods.

    A jolt at its beginning comes from another side in each run, so that runs of a policy differ.
    """
    seconds, commands, since = {
        "eight": (60.0, EIGHT, 50.4),
        "stop": (10.0, STOP, 5.5),
        "zig-zag": (60.0, "", 0.0),
        "moods": (60.0, "", 0.0),
    }[kind]
    drive = zig_zag if kind == "zig-zag" else partial(random_drive, SteeringLimits())
    for seed in options.seeds(5):
        side = np.random.default_rng(seed).uniform(-math.pi, math.pi)
        x, y = JOLT / JOLT_LASTS * math.cos(side), JOLT / JOLT_LASTS * math.sin(side)
        yield Case(
            kind,
            seconds,
            {"reference": "steered"},
            {"wrench_duration": JOLT_LASTS},
            planner(seed),
            pushes=[f"root:{x!r},{y!r},0@0.3"],
            commands=commands or drive(seconds, 100 + seed),
            since=since,
        )


def zig_zag(seconds: float, seed: int) -> str:
    """Velocities as `--cmd-vel` takes them: ahead at any speed, to the left and right in turn."""
    rng, time, drive = np.random.default_rng((seed, 8)), 0.0, list[str]()
    side = rng.choice((-1.0, 1.0))
    while time < seconds:
        speed = rng.uniform(*ZIG_ZAG_SPEEDS)
        turn = side * min(rng.uniform(*ZIG_ZAG_TURNS), SHARPEST / speed)
        drive.append(f"{speed:.3f},0,{turn:.3f}@{time:.3f}")
        side, time = -side, time + rng.uniform(*ZIG_ZAG_LASTS)
    return " ".join(drive)


def measure_course(seen: Seen) -> dict[str, Fact]:
    """How far the root is off the commands' course at the same tick; how soon it stops."""
    roots = seen.position[:, :2]
    course = np.array([(each.x, each.y) for each in seen.courses])
    errors = np.linalg.norm(roots - course, axis=1)
    return {
        "upright": seen.fell_at is None,
        "path error, m": float(errors.max()),
        "its mean, m": float(errors.mean()),
        "stands after, s": time_to_stop(roots[seen.measured], seen.rate),
    }


def time_to_stop(roots: FloatArray, rate: int) -> float:
    """How long after the first row a root stands for good, s; infinite if it does not.

    It stands while its speed over the ground, mean over the 0.25 s around, is below 0.15 m/s.
    `roots` (t, 2) are its places on the ground, m.
    """
    ticks = round(OVER * rate)
    moved = np.linalg.norm(roots[ticks:] - roots[:-ticks], axis=1)
    moves = np.flatnonzero(moved > STANDS * OVER)
    if len(moved) == 0 or (len(moves) and moves[-1] == len(moved) - 1):
        return math.inf
    return float(moves[-1] + 1 + ticks / 2) / rate if len(moves) else 0.0


TABLES: Mapping[str, RunTable] = {
    "clips": RunTable(
        "clips, planned",
        available_clips(load_character("humanoid")),
        clip_cases,
        measure_clip,
    ),
    "pushes": RunTable(
        "what the planner does not know of",
        [*PUSH_KINDS],
        push_cases,
        measure_push,
        asked_for=("jolt", "drags", "heavy balls", "any"),
    ),
    "courses": RunTable(
        "commanded courses, planned",
        ["eight", "stop", "zig-zag", "moods"],
        course_cases,
        measure_course,
    ),
}
