"""What state machines can do: walks as they are told, jumps and runs that are nudged."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from benchmarks.tables.case import Case, Fact
from benchmarks.tables.many import Options, RunTable
from benchmarks.tables.planned import time_to_stop
from benchmarks.tables.seen import Seen
from controller_node.behaviours.state_machine.file import read_machine
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

WALKS = ("speeds", "headings", "pushes", "steps", "grid", "slalom", "bends")
SPEEDS = (0.3, 0.6, 0.9, 1.2)  # m/s
AHEAD, ASIDE = 120.0, 60.0  # forces of pushes, N
STEP, STEP_LENGTH = 0.03, 0.8  # m, of the ground up or down, and from one to the next
TURN = 0.5  # rad/s while it turns to a heading
GRID = ((0.0, 0.3, 0.6, 0.9, 1.2), (-0.5, -0.25, 0.0, 0.25, 0.5), (-0.3, 0.0, 0.3))
"""Speeds ahead, m/s, turn rates, rad/s, and velocities to the left, m/s."""
BENDS = ((0.6, 0.3), (0.6, -0.5), (0.9, -0.3), (0.9, 0.5))  # m/s and rad/s
SLALOM, SLALOM_TURN, SLALOM_HALF = 0.9, 0.5, 4.0  # m/s, rad/s, s of each bend
PUSHED = {"wrench_duration": 0.2}  # s
NUDGE = (10.0, 30.0)  # N, least and most
FLIGHT, STANDING, STILL, UPRIGHT = 0.25, 3.0, 0.1, 0.98
"""Of a jump that succeeds: s without contact, s from then to the end, m/s and cosine there."""
RUN_SPEED, COMMANDED, AIRBORNE = 2.0, 2.1, 0.1
"""Of a run that succeeds: m/s covered where so much is commanded, share of time in the air."""
RUN_SECONDS, NUDGE_PERIOD = 20.0, 4.0  # s that are measured, and s in which one nudge comes


def machine_case(row: str, seconds: float, machine: str, **more: object) -> Case:
    """A run of a machine: the name of a shipped one, or a file."""
    controller = {"behaviour": "state_machine", "machine": machine}
    return Case(row, seconds, controller=controller, **more)  # type: ignore[arg-type]


# Walks


def walk_cases(kind: str, options: Options) -> Iterator[Case]:
    """The walks of a kind."""
    seconds, machine = options.seconds or 60.0, options.machine or "walk"
    rng = np.random.default_rng(options.first_seed)
    if kind == "speeds":
        for speed in SPEEDS:
            commands = f"{speed},0,0@0.5"
            yield machine_case(f"{speed:g} m/s", seconds, machine, commands=commands, since=5.0)
    elif kind == "headings":
        for part in range(8):
            heading = math.remainder(part * math.tau / 8, math.tau)
            turned = 1.0 + abs(heading) / TURN
            turn = math.copysign(TURN, heading)
            commands = f"0.6,0,{turn:g}@1 0.6,0,0@{turned:.4f}" if heading else "0.6,0,0@1"
            yield machine_case(kind, seconds, machine, commands=commands, since=turned + 4.0)
    elif kind in ("pushes", "bends"):
        yield from _pushed_walks(kind, machine, BENDS if kind == "bends" else [(0.6, 0.0)], rng)
    elif kind == "grid":
        for speed, turn, left in itertools.product(*GRID):
            commands = f"{speed:g},{left:g},{turn:g}@0.5"
            yield machine_case(kind, options.seconds or 15.0, machine, commands=commands, since=5.0)
    elif kind == "slalom":
        halves = range(math.ceil((seconds - 1.0) / SLALOM_HALF))
        turns = [(SLALOM_TURN * (-1) ** half, 1.0 + SLALOM_HALF * half) for half in halves]
        commands = " ".join(f"{SLALOM:g},0,{turn:g}@{time:g}" for turn, time in turns)
        yield machine_case(kind, seconds, machine, commands=commands, since=5.0)
    else:
        for number in range(8):
            heights = np.cumsum(STEP * rng.choice((-1.0, 1.0), 12)).tolist()
            ground = options.folder / f"steps_{number}.urdf"
            ground.write_text(steps_urdf(heights, 1.2 + 0.1 * number))
            simulator = {"terrain": str(ground)}
            commands = "0.6,0,0@0.5"
            yield machine_case(
                kind, 20.0, machine, simulator=simulator, commands=commands, since=5.0
            )


def _pushed_walks(
    kind: str, machine: str, bends: Sequence[tuple[float, float]], rng: np.random.Generator
) -> Iterator[Case]:
    """Walks at speeds and turn rates, pushed ahead, back and to the sides of their headings."""
    for number in range(24):
        speed, turn = bends[number % len(bends)]
        x, y = ((1, 0), (-1, 0), (0, 1), (0, -1))[(0, 1, 2, 0, 1, 3)[number % 6]]
        force = AHEAD * abs(x) + ASIDE * abs(y)
        at = 4.0 + 2.0 * float(rng.uniform())
        heading = turn * (at - 0.5)
        cosine, sine = math.cos(heading), math.sin(heading)
        ahead, left = force * (cosine * x - sine * y), force * (sine * x + cosine * y)
        yield machine_case(
            kind,
            12.0,
            machine,
            simulator=PUSHED,
            pushes=[f"root:{ahead:.5g},{left:.5g},0@{at:.4f}"],
            commands=f"{speed:g},0,{turn:g}@0.5",
            since=8.0,
        )


def steps_urdf(heights: Sequence[float], start: float) -> str:
    """A ground of steps across x from `start` on, of heights in m, as a URDF."""
    thickness, ends = 1.0, [start + STEP_LENGTH * number for number in range(len(heights) + 1)]
    lows, highs = [start - 20.0, *ends], [*ends, ends[-1] + 20.0]
    spans = zip(lows, highs, [0.0, *heights, heights[-1]], strict=True)
    shapes = "".join(
        f'<collision><origin xyz="{0.5 * (low + high):.6f} 0 {height - 0.5 * thickness:.6f}"/>'
        f'<geometry><box size="{high - low:.6f} 20 {thickness}"/></geometry></collision>'
        for low, high, height in spans
    )
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    return (
        '<robot name="steps"><link name="ground"><inertial><mass value="0"/>'
        f"{inertia}</inertial>{shapes}</link></robot>"
    )


def measure_walk(seen: Seen) -> dict[str, Fact]:
    """Means, from the time on that is measured: speed ahead, and how far it faces elsewhere."""
    courses = seen.courses[seen.measured]
    heading = np.array([course.heading for course in courses])
    wanted = np.mean([course.forward for course in courses])
    velocity = seen.velocity[seen.measured]
    cosine, sine = np.cos(heading), np.sin(heading)
    ahead = cosine * velocity[:, 0] + sine * velocity[:, 1]
    facing = _axis(seen.position[seen.measured], (1.0, 0.0, 0.0))
    off = np.arctan2(facing[:, 1], facing[:, 0]) - heading
    return {
        "upright": seen.fell_at is None,
        "fell at, s": None if seen.fell_at is None else f"{seen.fell_at:.2f}",
        "speed, m/s": float(ahead.mean()),
        "wanted, m/s": float(wanted),
        "heading off, rad": float(np.abs((off + np.pi) % (2.0 * np.pi) - np.pi).mean()),
    }


def _axis(positions: FloatArray, axis: tuple[float, float, float]) -> FloatArray:
    """An axis of the root's frame in the world (t, 3), at positions (t, n)."""
    return rotations.rotate(rotations.exp(positions[:, 3:6]), np.array(axis))


# Jumps


def jump_cases(kind: str, options: Options) -> Iterator[Case]:
    """Jumps; nudged from half a second before they crouch to a second after they land."""
    machine = options.machine or "jump"
    if kind == "undisturbed":
        yield machine_case(kind, 6.5, machine)
    else:
        for seed in options.seeds(10):
            push = jump_nudge(seed)
            yield machine_case(kind, 6.5, machine, simulator=PUSHED, pushes=[push])


def jump_nudge(seed: int) -> str:
    """The nudge of a seed, from a random side at a random moment, as of `run --push`."""
    draws = np.random.default_rng(seed)
    time, side = draws.uniform(0.5, 3.1), draws.uniform(-math.pi, math.pi)
    return _nudge(time, side, draws.uniform(*NUDGE))


def _nudge(time: float, side: float, force: float) -> str:
    return f"root:{force * math.cos(side):.3f},{force * math.sin(side):.3f},0@{time:.3f}"


def measure_jump(seen: Seen) -> dict[str, Fact]:
    """The longest time without contact of a foot, and how it stands after it."""
    start, end = longest_span(seen.airborne)
    fell = seen.fell_at is not None
    flight = (end - start) / seen.rate
    standing = 0.0 if fell else seen.lasted - end / seen.rate
    still = float(np.linalg.norm(seen.velocity[-1, :3])) < STILL
    stands = (
        not fell and still and float(_axis(seen.position[-1:], (0.0, 1.0, 0.0))[0, 2]) > UPRIGHT
    )
    return {
        "succeeded": flight >= FLIGHT and standing >= STANDING and stands,
        "flight, s": flight,
        "standing, s": standing,
    }


def longest_span(holds: Iterable[bool]) -> tuple[int, int]:
    """First row, and the one after the last, of the longest time that something holds."""
    edges = np.flatnonzero(np.diff(np.r_[0, np.array([*holds], dtype=int), 0]))
    spans = [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]
    return max(spans, key=lambda span: span[1] - span[0], default=(0, 0))


# Runs


def run_cases(kind: str, options: Options) -> Iterator[Case]:
    """Runs that are nudged every 4 s, once they have their speed; or that are told to stop."""
    machine = options.machine or "run"
    since = 3.0 + COMMANDED / read_machine(machine).acceleration
    told = f"{COMMANDED:g},0,0@1"
    for seed in options.seeds(20 if kind == "nudged" else 40):
        if kind == "nudged":
            seconds = options.seconds or RUN_SECONDS
            nudges = run_nudges(seed, since, seconds)
            yield machine_case(
                kind, since + seconds, machine,
                simulator=PUSHED, pushes=nudges, commands=told, since=since,
            )  # fmt: skip
        else:
            stops = since + 2.0 * float(np.random.default_rng(seed).uniform())
            told_off = f"{told} 0,0,0@{stops:.3f}"
            yield machine_case(kind, stops + 8.0, machine, commands=told_off, since=stops)


def run_nudges(seed: int, since: float, seconds: float) -> list[str]:
    """The nudges of a seed, one in each 4 s of some seconds, as of `run --push`; none of seed 0."""
    draws, found = np.random.default_rng(seed), []
    for number in range(int(seconds / NUDGE_PERIOD) if seed else 0):
        time = since + NUDGE_PERIOD * number + draws.uniform(0.0, NUDGE_PERIOD - 0.4)
        found.append(_nudge(time, draws.uniform(-math.pi, math.pi), draws.uniform(*NUDGE)))
    return found


def measure_run(seen: Seen) -> dict[str, Fact]:
    """Speed over the ground and flights of a run; or whether it stands after the command."""
    position, airborne = seen.position[seen.measured], seen.airborne[seen.measured]
    if seen.case.row == "stops":
        return {
            "succeeded": seen.fell_at is None,
            "stands after, s": time_to_stop(position[:, :2], seen.rate),
        }
    speed = math.hypot(*(position[-1] - position[0])[:2].tolist()) * seen.rate / len(position)
    share = float(airborne.mean())
    return {
        "succeeded": seen.fell_at is None and speed >= RUN_SPEED and share >= AIRBORNE,
        "speed, m/s": speed,
        "in the air": share,
        "stands after, s": None,
    }


TABLES: Mapping[str, RunTable] = {
    "walk": RunTable("walks of a machine", WALKS, walk_cases, measure_walk),
    "jump": RunTable("jumps of a machine", ("undisturbed", "nudged"), jump_cases, measure_jump),
    "run": RunTable("runs of a machine", ("nudged", "stops"), run_cases, measure_run),
}
