"""How far a machine walks as it is told: `python -m benchmarks.athletics.walking`.

Kind `speeds` walks straight on at four speeds, `headings` turns to eight directions and walks on,
`pushes` is pushed for 0.2 s at random moments, `steps` goes over a ground of steps that it does not
know of. `grid` walks at five speeds, five turn rates and three velocities aside, `slalom` turns to
and fro, `bends` is pushed in bends. A walk ends by falling, as `metrics.falls` has it.
"""

import argparse
import itertools
import math
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
from rich.console import Console  # noqa: E402
from rich.progress import track  # noqa: E402
from rich.table import Table  # noqa: E402

from benchmarks.athletics.trial import Trial, Walk, walked, write_terrain  # noqa: E402
from controller_node.behaviours.state_machine.file import read_machine  # noqa: E402
from msgs_config.errors import ActuatedCharactersError  # noqa: E402

KINDS = ("speeds", "headings", "pushes", "steps", "grid", "slalom", "bends")
SPEEDS = (0.3, 0.6, 0.9, 1.2)  # m/s
AHEAD, ASIDE = 120.0, 60.0  # N, of pushes
STEP = 0.03  # m, of the ground up or down
TURN = 0.5  # rad/s while it turns to a heading
GRID = ((0.0, 0.3, 0.6, 0.9, 1.2), (-0.5, -0.25, 0.0, 0.25, 0.5), (-0.3, 0.0, 0.3))
"""Speeds ahead, m/s, turn rates, rad/s, and velocities to the left, m/s."""
GRID_SECONDS = 15.0
BENDS = ((0.6, 0.3), (0.6, -0.5), (0.9, -0.3), (0.9, 0.5))  # m/s and rad/s
SLALOM, SLALOM_TURN, SLALOM_HALF = 0.9, 0.5, 4.0  # m/s, rad/s, s of each bend
COLUMNS = ("kind", "walk", "fell at, s", "speed of wanted, m/s", "aside, m/s", "heading off, rad")


@dataclass(frozen=True)
class PlannedWalk:
    """A walk, and from when on it is measured."""

    kind: str
    label: str
    trial: Trial
    since: float  # s


def cases(kind: str, options: argparse.Namespace, folder: Path) -> Iterator[PlannedWalk]:
    """The walks of a kind."""
    rng = np.random.default_rng(options.seed)
    if kind == "speeds":
        for speed in SPEEDS:
            trial = Trial(options.seconds, f"{speed},0,0@0.5", rate=options.rate)
            yield PlannedWalk(kind, f"{speed:g} m/s", trial, 5.0)
    elif kind == "headings":
        yield from _headings(options)
    elif kind == "pushes":
        yield from _pushes(kind, ((0.6, 0.0),), options, rng)
    elif kind == "bends":
        yield from _pushes(kind, BENDS, options, rng)
    elif kind == "grid":
        for speed, turn, left in itertools.product(*GRID):
            command = f"{speed:g},{left:g},{turn:g}"
            trial = Trial(GRID_SECONDS, f"{command}@0.5", rate=options.rate)
            yield PlannedWalk(kind, command, trial, 5.0)
    elif kind == "slalom":
        yield _slalom(options)
    else:
        yield from _steps(options, rng, folder)


def _headings(options: argparse.Namespace) -> Iterator[PlannedWalk]:
    """Walks that turn to eight directions, and walk on."""
    for part in range(8):
        heading = math.remainder(part * math.tau / 8, math.tau)
        turned = 1.0 + abs(heading) / TURN
        turn = math.copysign(TURN, heading) if heading else 0.0
        commands = f"0.6,0,{turn:g}@1 0.6,0,0@{turned:.4f}" if heading else "0.6,0,0@1"
        trial = Trial(options.seconds, commands, rate=options.rate)
        yield PlannedWalk("headings", f"{math.degrees(heading):.0f} degrees", trial, turned + 4.0)


def _pushes(
    kind: str,
    bends: Sequence[tuple[float, float]],
    options: argparse.Namespace,
    rng: np.random.Generator,
) -> Iterator[PlannedWalk]:
    """Walks at speeds and turn rates, pushed ahead, back and to the sides of their headings."""
    for number in range(24):
        speed, turn = bends[number % len(bends)]
        x, y = ((1, 0), (-1, 0), (0, 1), (0, -1))[(0, 1, 2, 0, 1, 3)[number % 6]]
        force = options.scale * (AHEAD * abs(x) + ASIDE * abs(y))
        at = 4.0 + 2.0 * float(rng.uniform())
        heading = turn * (at - 0.5)
        cosine, sine = math.cos(heading), math.sin(heading)
        ahead, left = force * (cosine * x - sine * y), force * (sine * x + cosine * y)
        push = f"root:{ahead:.5g},{left:.5g},0@{at:.4f}"
        trial = Trial(
            12.0, f"{speed:g},0,{turn:g}@0.5", (push,), options.rate, {"wrench_duration": 0.2}
        )
        yield PlannedWalk(
            kind, f"{push} N" + (f", {speed:g}, {turn:g}" if turn else ""), trial, 8.0
        )


def _slalom(options: argparse.Namespace) -> PlannedWalk:
    """A walk through bends to the left and to the right, one after another."""
    bends = range(math.ceil((options.seconds - 1.0) / SLALOM_HALF))
    commands = [
        f"{SLALOM:g},0,{SLALOM_TURN * (-1) ** bend:g}@{1.0 + SLALOM_HALF * bend:g}"
        for bend in bends
    ]
    trial = Trial(options.seconds, " ".join(commands), rate=options.rate)
    return PlannedWalk("slalom", f"{SLALOM:g} m/s, {SLALOM_TURN:g} rad/s", trial, 5.0)


def _steps(
    options: argparse.Namespace, rng: np.random.Generator, folder: Path
) -> Iterator[PlannedWalk]:
    """Walks over a ground of steps that it does not know of."""
    for number in range(8):
        heights = np.cumsum(STEP * rng.choice((-1.0, 1.0), 12)).tolist()
        path = write_terrain(folder, f"steps_{number}", heights, 1.2 + 0.1 * number)
        simulator: dict[str, object] = {"terrain": str(path)}
        trial = Trial(20.0, "0.6,0,0@0.5", rate=options.rate, simulator=simulator)
        yield PlannedWalk("steps", f"steps {number}", trial, 5.0)


def row(case: PlannedWalk, walk: Walk) -> tuple[str, ...]:
    """A line of the table."""
    return (
        case.kind,
        case.label,
        f"{walk.lasted:.2f}" if walk.fell else "",
        f"{walk.speed:.2f} of {walk.wanted:.2f}",
        f"{walk.drift:+.2f}",
        f"{walk.heading_error:.2f}",
    )


def main() -> int:
    """Walk all cases of the kinds chosen; prints a table."""
    options = _parse()
    try:
        machine = read_machine(options.machine)
    except ActuatedCharactersError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    table, upright = Table(*COLUMNS), dict[str, list[bool]]()
    with tempfile.TemporaryDirectory() as name:
        chosen = [
            case for kind in options.kinds or KINDS for case in cases(kind, options, Path(name))
        ]
        try:
            for case in track(chosen, "walking", console=Console(stderr=True)):
                walk = walked(case.trial, machine, case.since)
                table.add_row(*row(case, walk))
                upright.setdefault(case.kind, []).append(not walk.fell)
                if options.verbose:
                    print(*row(case, walk), sep=" | ", flush=True)
        except ActuatedCharactersError as error:
            print(f"error: {error}", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print("interrupted; these are the walks so far", file=sys.stderr)
    Console().print(table)
    for kind, each in upright.items():
        print(f"{kind}: {sum(each)} of {len(each)} without a fall")
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.athletics.walking", description=__doc__
    )
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(KINDS)} (all)")
    parser.add_argument("--machine", default="walk", help="a shipped one, or a .yaml file (walk)")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a straight walk (60)")
    parser.add_argument("--rate", type=int, default=240, help="Hz (240)")
    parser.add_argument("--scale", type=float, default=1.0, help="of the pushes' forces (1)")
    parser.add_argument("--seed", type=int, default=1, help="of moments and grounds (1)")
    parser.add_argument("--verbose", action="store_true", help="print each walk as it ends")
    options = parser.parse_args()
    for kind in options.kinds:
        if kind not in KINDS:
            parser.error(f"there is no kind '{kind}'; there are: {', '.join(KINDS)}")
    return options


if __name__ == "__main__":
    sys.exit(main())
