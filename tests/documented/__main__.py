"""Runs the documented commands, and writes the page that lists them: `make documented`.

Those that take long are left out unless `--long` is given, and the page says so.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.documented.collecting import MADE, ROOT, collect
from tests.documented.promise import Promise, promise_of, read_promises
from tests.documented.trying import Outcome, Reader

PAGE = ROOT / "docs" / MADE
_KEPT = ROOT / "build" / "documented.json"  # outcomes, so that an interrupted round goes on
_HEAD = """# Documented commands

Each command of the pages, of `--help`, of `run` without options, of the scenes and of the examples,
and what was seen when it was run as written, to its end or to Ctrl-C: `make documented` runs them
and writes this page. Heights and tilts are the root's over the last 0.25 s, read from the bag.
`tests/documented/promises.yaml` has what each must show; a command without a promise there fails
`make test`.

| command | stands in | seen | processor, s |
| --- | --- | --- | --- |
"""


def main() -> int:
    """Run them as the options say; 0 if all kept their promises."""
    parser = argparse.ArgumentParser("python -m tests.documented", description=__doc__)
    parser.add_argument("--long", action="store_true", help="those that take long, too")
    parser.add_argument("--only", metavar="TEXT", help="those with this text in them; no page")
    parser.add_argument("--resume", action="store_true", help="leave out what has been seen")
    options = parser.parse_args()
    promises, places = read_promises(), collect()
    chosen = [
        command
        for command in places
        if (promise := promise_of(command, promises)) is not None
        and promise.is_tried
        and (options.long or not promise.long)
        and (options.only is None or options.only in command)
    ]
    outcomes = _read()
    if not options.resume:
        outcomes = {each: seen for each, seen in outcomes.items() if each not in chosen}
    try:
        _try([each for each in chosen if each not in outcomes], promises, outcomes)
    except KeyboardInterrupt:
        print(f"\ninterrupted; --resume goes on after {len(outcomes)}", file=sys.stderr)
        return 130
    if options.only is None:
        PAGE.write_text(page(places, promises, outcomes), encoding="utf-8")
    failed = [each for each in outcomes.values() if each.faults]
    print(f"{len(outcomes) - len(failed)} passed, {len(failed)} failed")
    return 1 if failed else 0


def _try(chosen: Sequence[str], promises: dict[str, Promise], outcomes: dict[str, Outcome]) -> None:
    _KEPT.parent.mkdir(exist_ok=True)
    # or a command that sets up .venv would do so from a folder that goes away
    subprocess.run(["make", "--silent", ".venv/.installed-test"], cwd=ROOT, check=True)
    with TemporaryDirectory(prefix="documented-") as folder:
        reader = Reader(Path(folder), promises)
        for number, command in enumerate(chosen, 1):
            begun = time.monotonic()
            outcome = outcomes[command] = reader.attempt(command)
            _KEPT.write_text(json.dumps([vars(each) for each in outcomes.values()]), "utf-8")
            first = command.splitlines()[-1 if command.startswith("export") else 0]
            wall = time.monotonic() - begun
            print(f"[{number}/{len(chosen)}, {wall:.0f} s] {first}\n    {outcome.seen}", flush=True)
            for fault in outcome.faults:
                print(f"    FAILED: {fault}", flush=True)


def _read() -> dict[str, Outcome]:
    try:
        rows = json.loads(_KEPT.read_text("utf-8"))
    except OSError:
        return {}
    return {row["command"]: Outcome(**row | {"faults": tuple(row["faults"])}) for row in rows}


def page(
    places: dict[str, list[str]], promises: dict[str, Promise], outcomes: dict[str, Outcome]
) -> str:
    """The page: a row for each command."""
    rows = []
    for command, where in places.items():
        promise = promise_of(command, promises)
        assert promise is not None, f"no promise: {command}"
        outcome = outcomes.get(command)
        if outcome is not None:
            seen = "; ".join((outcome.seen or "ends well", *(f"**{f}**" for f in outcome.faults)))
            cost = f"{outcome.cpu_s:.0f}"
        else:
            tested = promise.tested_by and f"run by {promise.tested_by}"
            seen, cost = tested or promise.elsewhere or "long; `--long` runs it", ""
        text = " ⏎ ".join(command.splitlines()).replace("|", "\\|")
        rows.append(f"| `{text}` | {', '.join(where)} | {seen} | {cost} |\n")
    return _HEAD + "".join(rows)


if __name__ == "__main__":
    sys.exit(main())
