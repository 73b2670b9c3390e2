"""How far a machine walks as it is told: `python -m benchmarks.athletics.walking`.

Kind `speeds` walks straight on at four speeds, `headings` turns to eight directions and walks on,
`pushes` is pushed for 0.2 s at random moments, `steps` goes over a ground of steps that it does not
know of. A walk ends by falling: the root lower than 0.55 m.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator
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

KINDS = ("speeds", "headings", "pushes", "steps")
SPEEDS = (0.3, 0.6, 0.9, 1.2)  # m/s
AHEAD, ASIDE = 120.0, 60.0  # N, of pushes
STEP = 0.03  # m, of the ground up or down
TURN = 0.6  # rad/s, to a heading
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
    rate, seconds = options.rate, options.seconds
    rng = np.random.default_rng(options.seed)
    if kind == "speeds":
        for speed in SPEEDS:
            trial = Trial(seconds, f"{speed},0,0@0.5", rate=rate)
            yield PlannedWalk(kind, f"{speed:g} m/s", trial, 5.0)
    elif kind == "headings":
        for part in range(8):
            heading = math.remainder(part * math.tau / 8, math.tau)
            turned = 1.0 + abs(heading) / TURN
            turn = math.copysign(TURN, heading) if heading else 0.0
            commands = f"0.6,0,{turn:g}@1 0.6,0,0@{turned:.4f}" if heading else "0.6,0,0@1"
            trial = Trial(seconds, commands, rate=rate)
            yield PlannedWalk(kind, f"{math.degrees(heading):.0f} degrees", trial, turned + 4.0)
    elif kind == "pushes":
        for number in range(24):
            x, y = ((1, 0), (-1, 0), (0, 1), (0, -1))[(0, 1, 2, 0, 1, 3)[number % 6]]
            force = options.scale * (AHEAD * abs(x) + ASIDE * abs(y))
            at = 4.0 + 2.0 * float(rng.uniform())
            push = f"root:{x * force:g},{y * force:g},0@{at:.4f}"
            world: dict[str, object] = {"wrench_duration": 0.2}
            trial = Trial(12.0, "0.6,0,0@0.5", (push,), rate, world)
            yield PlannedWalk(kind, f"{push} N", trial, 8.0)
    else:
        for number in range(8):
            heights = np.cumsum(STEP * rng.choice((-1.0, 1.0), 12)).tolist()
            path = write_terrain(folder, f"steps_{number}", heights, 1.2 + 0.1 * number)
            trial = Trial(20.0, "0.6,0,0@0.5", rate=rate, simulator={"terrain": str(path)})
            yield PlannedWalk(kind, f"steps {number}", trial, 5.0)


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
