"""Jumps of the machine `jump`, nudged: `python -m benchmarks.athletics.jumps`.

Each jump gets a nudge of 10 to 30 N for 0.2 s at its root, from a random side, at a random moment
from half a second before it crouches to a second after it lands. A jump counts that is in the air
for 0.25 s, without contact of either foot, and then stands for 3 s, still and upright at the end.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
from rich.console import Console  # noqa: E402
from rich.progress import track  # noqa: E402
from rich.table import Table  # noqa: E402

from benchmarks.athletics.trial import Moment, Trial, moments  # noqa: E402
from controller_node.behaviours.state_machine.description import Machine  # noqa: E402
from controller_node.behaviours.state_machine.file import read_machine  # noqa: E402
from msgs_config.errors import ActuatedCharactersError  # noqa: E402
from msgs_config.geometry import rotations  # noqa: E402

FLIGHT, STANDING = 0.25, 3.0  # s, the least of a jump that succeeds
SEARCHED = (
    "states.crouch.root.height=0.02",
    "states.crouch.root.pitch=0.06",
    "states.thrust.root.climb=0.06",
    "states.thrust.root.pitch=0.06",
    "states.thrust.pressure.ahead=0.008",
    "states.flight.duration=0.02",
    "states.flight.placement.length=0.01",
    "states.flight.placement.ahead=0.02",
    "states.flight.placement.gain=0.04",
    "states.land.root.height=0.02",
    "states.land.root.pitch=0.05",
    "states.land.pressure.gain=0.2",
    "states.land.pressure.side_gain=0.2",
)
"""Where numbers are in the file, and how far a search first moves them."""
SECONDS = 6.5
_AIM = 0.3  # s of flight that a search aims at
STILL, UPRIGHT = 0.1, 0.98  # m/s of the root; cosine of its tilt
_FIRST, _LAST = 0.5, 3.1  # s, the first and the last time of a push
_LEAST, _MOST, _LASTS = 10.0, 30.0, 0.2  # N, N, s: least and largest push, and how long it lasts


@dataclass(frozen=True)
class Jump:
    """What has become of a jump."""

    seed: int
    push: str  # as of `run --push`
    flight: float  # s, the longest without contact
    rise: float  # m, of the root above where it left the ground
    standing: float  # s from the flight to the end
    unrest: float  # m that the root moves over the ground after the flight
    stands: bool  # still and upright at the end

    @property
    def succeeded(self) -> bool:
        """Whether it flew and stood."""
        return self.flight >= FLIGHT and self.standing >= STANDING and self.stands


def small_push(seed: int) -> str:
    """A small push of a seed."""
    draws = np.random.default_rng(seed)
    time, side = draws.uniform(_FIRST, _LAST), draws.uniform(-math.pi, math.pi)
    force = draws.uniform(_LEAST, _MOST)
    return f"root:{force * math.cos(side):.3f},{force * math.sin(side):.3f},0@{time:.3f}"


def jump(machine: Machine, seed: int, push: str, rate: int = 240) -> Jump:
    """Jump once, with a push or without one (``""``)."""
    trial = Trial(
        SECONDS, pushes=[push] if push else [], rate=rate, simulator={"wrench_duration": _LASTS}
    )
    ticks = list(moments(trial, machine))
    start, end = _flight(ticks)
    last = ticks[-1]
    fell = last.time < SECONDS - 2.0 / rate
    upright = _cosine_of_tilt(last) > UPRIGHT
    still = float(np.linalg.norm(last.velocity[:3])) < STILL
    heights = [tick.position[2] for tick in ticks[start:end]]
    return Jump(
        seed,
        push,
        flight=(end - start) / rate,
        rise=float(max(heights) - heights[0]) if heights else 0.0,
        standing=0.0 if fell else last.time - ticks[end - 1].time,
        unrest=sum(math.hypot(*tick.velocity[:2].tolist()) for tick in ticks[end:]) / rate,
        stands=not fell and upright and still,
    )


def draw_nudges(rng: np.random.Generator, count: int, rate: int) -> list[str]:
    """Nudges of seeds that a search draws, whatever the rate."""
    return [small_push(int(seed)) for seed in rng.integers(1, 1 << 30, count)]


def search_cost(machine: Machine, pushes: Sequence[str]) -> float:
    """The mean cost of a machine: a fall, what is missing of a flight of 0.3 s, and the unrest."""
    costs = []
    for push in pushes:
        seen = jump(machine, 0, push)
        short = max(0.0, _AIM - seen.flight) / _AIM
        costs.append(10.0 * (not seen.stands) + 10.0 * short + seen.unrest)
    return sum(costs) / len(costs)


def _flight(ticks: list[Moment]) -> tuple[int, int]:
    """The longest time without contact of either foot, as rows; the first tick's is unknown."""
    best, start = (1, 1), None
    for row, tick in enumerate(ticks):
        if row and not any(tick.loads):
            start = row if start is None else start
            if row + 1 - start > best[1] - best[0]:
                best = (start, row + 1)
        else:
            start = None
    return best


def _cosine_of_tilt(moment: Moment) -> float:
    turn = rotations.exp(moment.position[3:6])
    return float(rotations.rotate(turn, np.array((0.0, 1.0, 0.0)))[2])  # y is up in its model


def main() -> int:
    """Jump, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", default="jump", help="a shipped one, or a file (%(default)s)")
    parser.add_argument("--runs", type=int, default=10, help="(%(default)s)")
    parser.add_argument("--first-seed", type=int, default=1, help="of the nudges (%(default)s)")
    options = parser.parse_args()
    if options.runs < 1:
        parser.error("--runs must be 1 or more")
    console = Console(width=100)
    seeds = range(options.first_seed, options.first_seed + options.runs)
    try:
        machine = read_machine(options.machine)
        tasks = [(0, ""), *((seed, small_push(seed)) for seed in seeds)]
        jumps = [jump(machine, *task) for task in track(tasks, console=console)]
    except ActuatedCharactersError as error:
        raise SystemExit(f"error: {error}") from error
    table = Table("seed", "push", "flight, s", "rise, m", "standing, s", "succeeded")
    for each in jumps:
        numbers = (f"{value:.3f}" for value in (each.flight, each.rise, each.standing))
        name = str(each.seed) if each.push else "none"
        table.add_row(name, each.push, *numbers, "yes" if each.succeeded else "no")
    console.print(table)
    nudged = [each for each in jumps if each.push]
    count = sum(each.succeeded for each in nudged)
    console.print(f"{count} of {len(nudged)} nudged jumps")
    return 0


if __name__ == "__main__":
    sys.exit(main())
