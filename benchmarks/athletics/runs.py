"""Runs of the machine `run`, nudged: `python -m benchmarks.athletics.runs`.

Each run begins standing, gets faster up to a speed, and is measured for 20 s from then on, while a
nudge of 10 to 30 N acts on its root for 0.2 s every 4 s, from a random side at a random moment. A
run counts that does not fall, covers 2 m/s in the mean, and has both feet in the air at least a
tenth of the time.
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

from benchmarks.athletics.trial import Moment, Trial, moments, walked  # noqa: E402
from controller_node.behaviours.state_machine.description import Machine  # noqa: E402
from controller_node.behaviours.state_machine.file import read_machine  # noqa: E402
from msgs_config.errors import ActuatedCharactersError  # noqa: E402

SPEED, AIRBORNE = 2.0, 0.1  # m/s and share of the time, the least of a run that succeeds
COMMANDED, TURN = 2.1, 0.3  # m/s, rad/s
MEASURED = 20.0  # s
SEARCHED = (
    "states.contact.duration=0.01",
    "states.contact.root.height=0.005",
    "states.contact.root.climb=0.03",
    "states.contact.root.pitch=0.02",
    "states.contact.pressure.ahead=0.005",
    "states.contact.placement.length=0.015",
    "states.contact.placement.ahead=0.02",
    "states.flight.duration=0.005",
    "states.flight.placement.length=0.005",
    "states.flight.placement.gain=0.01",
    "states.flight.placement.ahead=0.01",
    "states.flight.placement.width=0.01",
    "states.flight.placement.retract=0.05",
    "states.flight.placement.pace=0.05",
    "states.flight.targets.stance.knee=0.1",
)
"""Where numbers are in the file, and how far a search first moves them."""
_SEARCHED_FOR, _MEASURED_SINCE = 14.0, 4.0  # s, length of a search's trial, start of measurement
_CHANGES = (5.5, 8.0)  # s, between which the velocity changes
_LEAST_SPEED, _RUNS = 1.5, 1.8  # m/s, commanded at least, and from which on there are flights
_BEGINS = 1.0  # s, when the command comes
_EVERY, _LEAST, _MOST, _LASTS = 4.0, 10.0, 30.0, 0.2  # s, N, N, s: nudges' period, forces, length


@dataclass(frozen=True)
class Run:
    """What has become of a run."""

    seed: int
    lasted: float  # s, of the time that is measured
    speed: float  # m/s, mean, over the ground
    airborne: float  # share of the time
    flight: float  # s, mean of a flight

    @property
    def succeeded(self) -> bool:
        """Whether it ran, and did not fall."""
        return self.lasted > MEASURED - 0.01 and self.speed >= SPEED and self.airborne >= AIRBORNE


def nudges(seed: int, since: float, seconds: float) -> list[str]:
    """The pushes of a seed, as of `run --push`; none of seed 0."""
    if not seed:
        return []
    draws, found = np.random.default_rng(seed), []
    for number in range(int(seconds / _EVERY)):
        time = since + _EVERY * number + draws.uniform(0.0, _EVERY - 2.0 * _LASTS)
        side, force = draws.uniform(-math.pi, math.pi), draws.uniform(_LEAST, _MOST)
        x, y = force * math.cos(side), force * math.sin(side)
        found.append(f"root:{x:.3f},{y:.3f},0@{time:.3f}")
    return found


def run(machine: Machine, seed: int, speed: float, seconds: float = MEASURED) -> Run:
    """Run with the nudges of a seed, at a commanded speed in m/s."""
    since = _BEGINS + speed / machine.acceleration + 2.0
    trial = Trial(
        since + seconds,
        f"{speed:g},0,0@{_BEGINS:g}",
        nudges(seed, since, seconds),
        simulator={"wrench_duration": _LASTS},
    )
    ticks = flights = airborne = 0
    start = last = None
    for moment in moments(trial, machine):
        if moment.time < since:
            continue
        flies = not any(moment.loads)
        flights += flies and last is not None and any(last.loads)
        airborne += flies
        ticks, start, last = ticks + 1, start or moment, moment
    if start is None or last is None or not ticks:
        return Run(seed, 0.0, 0.0, 0.0, 0.0)
    x, y = (last.position - start.position)[:2].tolist()
    time = max(last.time - start.time, 1.0 / trial.rate)
    lasted = (ticks + 1) / trial.rate
    return Run(
        seed,
        lasted,
        math.hypot(x, y) / time,
        airborne / ticks,
        airborne / trial.rate / max(flights, 1),
    )


def draw_trials(rng: np.random.Generator, count: int, rate: int) -> list[Trial]:
    """Trials at random speeds and turns that change once, every other one to a stop, nudged."""
    return [_draw_trial(rng, rate, stops=number % 2 == 0) for number in range(count)]


def _draw_trial(rng: np.random.Generator, rate: int, *, stops: bool) -> Trial:
    changes = float(rng.uniform(*_CHANGES))
    velocities = [
        f"{rng.uniform(_LEAST_SPEED, COMMANDED):.3f},0,{rng.uniform(-TURN, TURN):.3f}"
        for _ in range(2)
    ]
    second = "0,0,0" if stops else velocities[1]
    nudged = (
        [] if stops else nudges(int(rng.integers(1, 1 << 30)), changes, _SEARCHED_FOR - changes)
    )
    commands = f"{velocities[0]}@{_BEGINS:g} {second}@{changes:.3f}"
    return Trial(_SEARCHED_FOR, commands, nudged, rate, {"wrench_duration": _LASTS})


def search_cost(machine: Machine, trials: Sequence[Trial]) -> float:
    """The mean cost of a machine: a fall, errors of its velocity, and what it lacks of flights."""
    costs = []
    for trial in trials:
        ticks = airborne = 0

        def watch(moment: Moment) -> None:
            nonlocal ticks, airborne
            if moment.course.forward > _RUNS:
                ticks, airborne = ticks + 1, airborne + (not any(moment.loads))

        seen = walked(trial, machine, _MEASURED_SINCE, watch)
        lacks = max(0.0, 1.5 * AIRBORNE - airborne / max(ticks, 1))
        left = 1.0 - seen.lasted / trial.seconds if seen.fell else 0.0
        errors = abs(seen.speed - seen.wanted) + abs(seen.drift) + seen.heading_error
        costs.append(20.0 * (seen.fell + left) + 4.0 * errors + 40.0 * lacks)
    return sum(costs) / len(costs)


def main() -> int:
    """Run, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", default="run", help="a shipped one, or a file (%(default)s)")
    parser.add_argument(
        "--speed", type=float, default=COMMANDED, help="m/s, commanded (%(default)s)"
    )
    parser.add_argument("--runs", type=int, default=5, help="(%(default)s)")
    parser.add_argument("--first-seed", type=int, default=1, help="of the nudges (%(default)s)")
    options = parser.parse_args()
    if options.runs < 1 or options.speed <= 0.0:
        parser.error("--runs must be 1 or more, --speed more than 0")
    console = Console(width=100)
    seeds = range(options.first_seed, options.first_seed + options.runs)
    try:
        machine = read_machine(options.machine)
        runs = [run(machine, seed, options.speed) for seed in track(seeds, console=console)]
    except ActuatedCharactersError as error:
        raise SystemExit(f"error: {error}") from error
    table = Table("seed", "lasted, s", "speed, m/s", "in the air", "a flight, s", "succeeded")
    for each in runs:
        numbers = (each.lasted, each.speed, each.airborne, each.flight)
        verdict = "yes" if each.succeeded else "no"
        table.add_row(str(each.seed), *(f"{value:.3f}" for value in numbers), verdict)
    console.print(table)
    count = sum(each.succeeded for each in runs)
    console.print(f"{count} of {len(runs)} runs of {SPEED:g} m/s or more")
    return 0


if __name__ == "__main__":
    sys.exit(main())
