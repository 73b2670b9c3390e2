"""Many runs, and a table of what became of them: `python -m benchmarks.tables TABLE`.

The tables of the pages: `clips`, `pushes` and `courses` are planned, by joint torques alone;
`walk`, `jump` and `run` are of state machines; `captures` imports BVH files, and tracks them;
`ground` has how deep clips sink into each engine's ground; `terrain` walks over stairs, slopes and
unseen steps, planned. A row is a kind of run; its yes or no
are counted, and of numbers there are the median and, in brackets, the least and the largest. Runs
are in one process each, as over topics.
"""

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from msgs_config.runtime.process import limit_threads

limit_threads()

from rich.console import Console  # noqa: E402 - after the limit on threads
from rich.progress import Progress  # noqa: E402

from benchmarks.support.printed import make_table  # noqa: E402
from benchmarks.tables import captures, ground, machines, planned, terrain  # noqa: E402
from benchmarks.tables.case import heavier  # noqa: E402
from benchmarks.tables.many import Options, Result, RunTable, cell, results, rows  # noqa: E402
from benchmarks.tables.push_map import draw  # noqa: E402
from msgs_config.errors import ActuatedCharactersError, ConfigurationError, one_of  # noqa: E402

_WIDTH = 140  # characters; enough for every table
TABLES: Mapping[str, RunTable] = {
    **planned.TABLES,
    **machines.TABLES,
    **captures.TABLES,
    **ground.TABLES,
    **terrain.TABLES,
}


def main() -> int:
    """Make the runs, and print the table."""
    parser = argparse.ArgumentParser("python -m benchmarks.tables", description=__doc__)
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="rows, or files of captures (all)")
    parser.add_argument("--runs", type=int, help="of each row that differs by a seed")
    parser.add_argument("--first-seed", type=int, default=1, help="(1)")
    parser.add_argument("--seconds", type=float, help="of each run, or of what is measured of it")
    parser.add_argument("--set", action="append", default=[], help="NODE.NAME:=VALUE, as of run")
    parser.add_argument("--mass", type=float, help="factor on each link's, unknown to controllers")
    parser.add_argument("--machine", default="", help="another machine's name or file")
    parser.add_argument("--processes", type=int, default=2, help="(2)")
    parser.add_argument("--out", type=Path, help="file for what is measured of each run, JSON")
    parser.add_argument("--picture", type=Path, help="PNG of the limits, for `pushes any`")
    options = parser.parse_args()
    if min(options.processes, options.runs or 1) < 1:
        parser.error("--runs and --processes must be 1 or more")
    if options.picture and (options.table, options.kinds) != ("pushes", ["any"]):
        parser.error("--picture is for `pushes any`")
    try:
        with TemporaryDirectory() as folder:
            done = _runs(options, Path(folder))
    except ActuatedCharactersError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    if options.out:
        content = [{"row": case.row, **facts} for case, facts in done]
        options.out.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    if options.picture:
        draw(done, options.picture)
    return 0


def _runs(options: argparse.Namespace, folder: Path) -> list[Result]:
    """What becomes of all cases that are asked for; prints each, and the table."""
    table, console = TABLES[options.table], Console(width=_WIDTH)
    chosen = options.kinds or [kind for kind in table.kinds if kind not in table.asked_for]
    for kind in chosen:
        if kind not in table.kinds and not table.takes_files:
            raise ConfigurationError(one_of("kind", kind, list(table.kinds)))
    seconds, machine = options.seconds, options.machine
    asked = Options(options.runs, options.first_seed, seconds, machine, folder)
    settings = tuple(options.set)
    cases = [
        replace(case, settings=settings) for kind in chosen for case in table.cases(kind, asked)
    ]
    if options.mass is not None:
        world = heavier(cases[0].character, options.mass, folder)
        cases = [replace(case, world=world) for case in cases]
    cases[0].plan()  # a mistake shows at once
    done: list[Result] = []
    with Progress(console=console) as progress:
        bar = progress.add_task("runs", total=len(cases))
        for case, facts in results(cases, table.measure, options.processes, folder):
            done.append((case, facts))
            known = {name: fact for name, fact in facts.items() if fact is not None}
            words = ", ".join(f"{name}: {cell([fact])}" for name, fact in known.items())
            progress.print(f"{case.row}: {words}", highlight=False)
            progress.advance(bar)
    console.print(make_table(table.title, *rows(done)))
    return done


if __name__ == "__main__":
    sys.exit(main())
