"""Finds parameters of a machine by CMA-ES: `python -m benchmarks.athletics.search`.

Each candidate walks some short trials in the simulator, at speeds and turns and under pushes that
change from generation to generation. Its cost is what it fell short of them, the error of its
speed, its drift aside, the error of its heading, and its effort. With `--task jump` it jumps, with
`--task run` it runs, round bends, nudged, and stops. The best machine so far is written after every
generation; Ctrl-C ends the search and keeps it.

Source: Hansen and Ostermeier 2001, "Completely Derandomized Self-Adaptation in Evolution
Strategies"; the extra `search` brings the package `cma`.
"""

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
import yaml  # noqa: E402

from benchmarks.athletics import jumps, runs  # noqa: E402
from benchmarks.athletics.trial import Trial, Walk, walked  # noqa: E402
from controller_node.behaviours.state_machine.description import Machine  # noqa: E402
from controller_node.behaviours.state_machine.file import (  # noqa: E402
    machine_path,
    make_machine,
    read_content,
)
from msgs_config.errors import ActuatedCharactersError, ConfigurationError  # noqa: E402
from msgs_config.extras import require_extra  # noqa: E402

SEARCHED = (
    "states.step.duration=0.04",
    "states.step.root.height=0.015",
    "states.step.root.pitch=0.03",
    "states.step.pressure.gain=0.3",
    "states.step.pressure.side_gain=0.3",
    "states.step.placement.width=0.015",
    "states.step.placement.depth=0.005",
    "states.step.placement.pace=0.1",
    "states.stride.placement.pace=0.1",
    "states.step.placement.ahead=0.01",
    "states.step.placement.clearance=0.015",
    "states.stride.placement.width=0.015",
)
"""Where numbers are in the file, and how far they are first moved."""

FALL, SPEED, DRIFT, HEADING, EFFORT = 10.0, 4.0, 4.0, 2.0, 0.1  # weights of the cost's parts
SECONDS = 9.0  # s of a trial
MOST_SPEED, MOST_ASIDE, MOST_TURN = 1.2, 0.3, 0.5  # m/s, m/s, rad/s: the largest commands
AHEAD, ASIDE = 100.0, 50.0  # N, of pushes


def place_of(content: dict[str, Any], path: str) -> tuple[dict[str, Any], str]:
    """The mapping that holds a number, and its key there; keys may contain dots.

    Raises:
        ConfigurationError: there is no number.
    """
    holder, rest = content, path
    while True:
        if isinstance(holder.get(rest), (int, float)) and not isinstance(holder[rest], bool):
            return holder, rest
        inside = [
            key for key in holder if rest.startswith(f"{key}.") and isinstance(holder[key], dict)
        ]
        if not inside:
            raise ConfigurationError(f"there is no number at '{path}'; write it as in the file")
        rest = rest.removeprefix(f"{inside[0]}.")
        holder = holder[inside[0]]


def changed(
    content: dict[str, Any], paths: Sequence[str], numbers: Sequence[float]
) -> dict[str, Any]:
    """The content with other numbers at some places."""
    copy = deepcopy(content)
    for path, number in zip(paths, numbers, strict=True):
        holder, key = place_of(copy, path)
        holder[key] = float(number)
    return copy


def trials(rng: np.random.Generator, count: int, rate: int) -> list[Trial]:
    """Trials at random velocities that change once, each pushed once from a random side."""
    return [_trial(rng, rate) for _ in range(count)]


def _trial(rng: np.random.Generator, rate: int) -> Trial:
    first, second = _velocity(rng), _velocity(rng)
    changes, pushed = float(rng.uniform(3.0, 6.0)), float(rng.uniform(3.0, 6.5))
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    x, y = AHEAD * np.cos(angle), ASIDE * np.sin(angle)
    return Trial(
        SECONDS,
        f"{first}@0.5 {second}@{changes:.2f}",
        (f"root:{x:.2f},{y:.2f},0@{pushed:.4f}",),
        rate,
        {"wrench_duration": 0.2},
    )


def _velocity(rng: np.random.Generator) -> str:
    """A velocity as of `--cmd-vel`, of those that a machine is to walk at."""
    speed, left, turn = rng.uniform(
        (0.0, -MOST_ASIDE, -MOST_TURN), (MOST_SPEED, MOST_ASIDE, MOST_TURN)
    )
    return f"{speed:.3f},{left:.3f},{turn:.3f}"


def cost_of(walk: Walk, seconds: float) -> float:
    """The cost of a trial."""
    if walk.fell:
        return FALL * (2.0 - walk.lasted / seconds)
    return (
        SPEED * abs(walk.speed - walk.wanted)
        + DRIFT * abs(walk.drift)
        + HEADING * walk.heading_error
        + EFFORT * walk.effort
    )


def cost(machine: Machine, given: Sequence[Trial]) -> float:
    """The mean cost of a machine in some trials."""
    return float(np.mean([cost_of(walked(trial, machine, 3.5), trial.seconds) for trial in given]))


@dataclass(frozen=True)
class Task:
    """What a machine is to do."""

    searched: Sequence[str]
    draw: Callable[[np.random.Generator, int, int], Sequence[Any]]  # trials: given their number, Hz
    cost: Callable[[Machine, Sequence[Any]], float]


TASKS = {
    "walk": Task(SEARCHED, trials, cost),
    "jump": Task(jumps.SEARCHED, jumps.draw_nudges, jumps.search_cost),
    "run": Task(runs.SEARCHED, runs.draw_trials, runs.search_cost),
}


def parse_move(text: str) -> tuple[str, float]:
    """Where a number is in the file, and how far it is first moved.

    Raises:
        ConfigurationError: the text is not PLACE=STEP, with a step of more than 0.
    """
    place, _, step = text.partition("=")
    try:
        if not 0.0 < float(step) < math.inf:
            raise ValueError
    except ValueError:
        raise ConfigurationError(
            f"--move {text}: it must be PLACE=STEP, a step of more than 0, as {SEARCHED[0]}"
        ) from None
    return place, float(step)


def search(options: argparse.Namespace) -> Iterator[int]:
    """Search; yields the number of each generation when its best machine is written."""
    import cma

    task = TASKS[options.task]
    path = machine_path(options.machine or options.task)
    content = read_content(path)
    moves = dict(parse_move(text) for text in options.move or task.searched)
    places = list(moves)
    start = [holder[key] for holder, key in (place_of(content, place) for place in places)]
    settings = {
        "seed": options.seed,
        "popsize": options.population,
        "verbose": -9,
        "CMA_stds": np.array(list(moves.values())),
    }
    evolution = cma.CMAEvolutionStrategy(start, 0.3, settings)
    rng = np.random.default_rng(options.seed)
    for generation in range(1, options.generations + 1):
        given = task.draw(rng, options.trials, options.rate)
        asked = evolution.ask()
        costs = []
        for number, candidate in enumerate(asked, 1):
            costs.append(_cost_or_worst(task, path, changed(content, places, candidate), given))
            done = f"generation {generation}: {number} of {len(asked)}, cost {costs[-1]:.3f}"
            print(done, end="\r", file=sys.stderr, flush=True)
        evolution.tell(asked, costs)
        mean = evolution.result.xfavorite
        write(options.output, changed(content, places, mean))
        numbers = ", ".join(f"{p}={v:.4g}" for p, v in zip(places, mean, strict=True))
        print(f"generation {generation}: best {min(costs):.3f}, median {np.median(costs):.3f}")
        print(f"  {numbers}", flush=True)
        yield generation


def _cost_or_worst(task: Task, path: Path, content: dict[str, Any], given: Sequence[Any]) -> float:
    """The cost of a file's content; more than that of any fall if it is no machine."""
    try:
        return task.cost(make_machine(path, content), given)
    except ConfigurationError:
        return 3.0 * FALL


def write(path: Path, content: dict[str, Any]) -> None:
    """Write a machine's file."""
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None))


def main() -> int:
    """Search as the options say."""
    parser = argparse.ArgumentParser("python -m benchmarks.athletics.search", description=__doc__)
    parser.add_argument("--task", choices=TASKS, default="walk", help="(walk)")
    parser.add_argument("--machine", help="to begin with: a name or a file (that of the task)")
    parser.add_argument("--output", type=Path, default=Path("found.yaml"), help="(found.yaml)")
    parser.add_argument(
        "--move",
        action="append",
        metavar="PLACE=STEP",
        help="a number in the file, and how far it is first moved; may be repeated",
    )
    parser.add_argument("--generations", type=int, default=40, help="(40)")
    parser.add_argument("--population", type=int, default=10, help="(10)")
    parser.add_argument("--trials", type=int, default=4, help="of each candidate (4)")
    parser.add_argument("--rate", type=int, default=240, help="Hz (240)")
    parser.add_argument("--seed", type=int, default=1, help="(1)")
    options = parser.parse_args()
    if not options.output.absolute().parent.is_dir():
        parser.error(f"--output {options.output}: there is no such folder")
    if min(options.generations, options.population - 1, options.trials, options.rate) < 1:
        parser.error("--generations, --trials and --rate must be 1 or more, --population 2")
    done = 0
    try:
        require_extra("search", "the search")
        for generation in search(options):
            done = generation
    except KeyboardInterrupt:
        found = options.output if done else "none; no generation is over"
        print(f"\ninterrupted; the best so far: {found}", file=sys.stderr)
        return 130
    except (ActuatedCharactersError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
