"""The command `actuated_characters info`: the contents of a bag."""

import argparse
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from actuated_characters.commands.common.recovering import recover_bag
from actuated_characters.commands.common.settings import Commands, add_bag, add_command
from actuated_characters.commands.common.tables import make_facts_table, make_table, show

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.report.contents import CharacterContents, Contents
    from actuated_characters.report.ticks import TickFacts

_MOST_LISTED = 12  # gaps, pauses and events; --json has all
_NS_PER_S = 10**9
_SIZES = ("B", "kB", "MB", "GB")


def add_info(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    info = add_command(
        commands,
        _info,
        "info",
        "say what is in a bag",
        "Say what is in a bag: files, topics with counts and rates, and each character with its "
        "law and gains. That is known without reading the messages, however many there are. Of a "
        "bag of something else, the topics.",
        ["info runs/demo", "info runs/demo --ticks"],
    )
    add_bag(info)
    info.add_argument(
        "--ticks",
        action="store_true",
        help="read each message, too: missing and late ticks, gaps between messages, pauses, what "
        "happened (pushes, throws, resets, modes, changed parameters, a fall), joints at their "
        "limits, errors of plans",
    )
    info.add_argument("--json", action="store_true", help="print all of it as JSON")
    info.add_argument(
        "--recover",
        action="store_true",
        help="first make the bag complete, where its recorder was killed, the disk was full or a "
        "copy broke off; the old one is kept beside it as BAG.damaged, and a run gets the figures "
        "that it lacks. A complete bag is not touched",
    )


def _info(options: argparse.Namespace) -> None:
    from actuated_characters.report.contents import read_contents

    if options.recover:
        recover_bag(options.bag)
    contents, ticks = read_contents(options.bag), list["TickFacts"]()
    if options.ticks:
        from actuated_characters.report.ticks import read_ticks

        contents, ticks = read_ticks(contents)
    if options.json:
        runs = [asdict(run) for run in ticks] if options.ticks else None
        content = _finite({**asdict(contents), "runs": runs})
        print(json.dumps(content, indent=2, allow_nan=False))
        return
    console = Console()
    console.print(make_facts_table(contents.bag, _bag_rows(contents, options.ticks)))
    console.print(_topics_table(contents))
    for character in contents.characters:
        rows = _character_rows(character)
        console.print(make_facts_table(_title(character.name, character.character), rows))
        if character.gains:
            console.print(_gains_table(character))
    for run in ticks:
        console.print(make_facts_table(_title(run.name, "ticks"), _tick_rows(run)))
    if contents.lacks is not None:
        console.print(f"no more than that: {contents.lacks}", soft_wrap=True, markup=False)


def _title(name: str, what: str) -> str:
    return f"{name}: {what}" if name else what


def _bag_rows(contents: "Contents", exact: bool) -> Iterator[tuple[str, str]]:
    files = ", ".join(f"{name} ({_size(size)})" for name, size in contents.files.items())
    yield "files", f"{_size(contents.size_bytes)}: {files}"
    version = "unknown" if contents.metadata_version is None else str(contents.metadata_version)
    yield (
        "storage",
        f"{contents.storage}, compression {contents.compression}, metadata version {version}, "
        f"written by {contents.ros_distro}",
    )
    if contents.forked_from is not None:
        yield "forked from", str(contents.forked_from)
    if contents.start_ns is not None:
        start = datetime.fromtimestamp(contents.start_ns // _NS_PER_S, tz=UTC)
        yield "begun", start.strftime("%Y-%m-%d %H:%M:%S UTC")
    unknown = "unknown, log times are simulated; of MCAP --ticks reads the others"
    yield "wall time", _seconds(contents.wall_time_s) or unknown
    about = "" if exact or contents.sim_time_s is None else "about "
    yield "simulated time", about + (_seconds(contents.sim_time_s) or "unknown")


def _seconds(time: float | None) -> str:
    return "" if time is None else f"{time:.6g} s"


def _topics_table(contents: "Contents") -> Table:
    columns = ["name and type", "count", "per s", "per sim. s"]
    if any(topic.largest_gap_s is not None for topic in contents.topics):
        columns.append("largest gap (s)")
    rows = []
    for topic in contents.topics:
        times = (contents.wall_time_s, contents.sim_time_s)
        rates = (topic.count / time if time else None for time in times)
        numbers = (topic.count, *rates, topic.largest_gap_s)
        name = Text.assemble(topic.name, "\n  ", (topic.type, "dim"))
        rows.append([name, *map(show, numbers[: len(columns) - 1])])
    return make_table("topics", columns, rows)


def _character_rows(character: "CharacterContents") -> Iterator[tuple[str, str]]:
    yield (
        "character",
        f"{character.character}, {character.degrees_of_freedom} degrees of freedom, "
        f"{character.mass:.4g} kg, {character.rate_hz} Hz, {character.mode or 'mode unknown'}",
    )
    yield "states", str(character.states)
    yield "law", character.law or "not recorded"
    if character.versions:
        yield "versions", ", ".join(map(" ".join, character.versions.items()))


def _gains_table(character: "CharacterContents") -> Table:
    rows = [
        (row.joint, *("-" if v is None else f"{v:g}" for v in (row.p, row.d, row.i, row.limit)))
        for row in character.gains
    ]
    title = _title(character.name, "gains and limits in force at the start")
    return make_table(title, ("joint", "p", "d", "i", "limit"), rows)


def _tick_rows(run: "TickFacts") -> Iterator[tuple[str, str]]:
    again = f", {run.repeated} states published again" if run.repeated else ""
    yield "ticks", f"{run.ticks}, {_seconds(run.sim_time_s)}{again}"
    gaps = (str(a) if a == b else f"{a} to {b}" for a, b in run.missing)
    listed = _listed(gaps, separator=", ")
    yield "missing ticks", f"{run.missing_count}: {listed}" if run.missing else "none"
    if run.tick_us:
        yield "from tick to tick", _times_line(run.tick_us)
    if run.late:
        times = _times_line(run.late)
        lateness = f"; lateness {times}, pauses left out" if times else ""
        yield "late ticks", f"{int(run.late['ticks'])} by more than a period{lateness}"
    pauses = (f"{p.duration:.3g} s of wall time at {p.start:.4g} s" for p in run.pauses)
    yield "pauses", _listed(pauses)
    yield "events", _listed(f"at {event.start:.4g} s: {event.text}" for event in run.events)
    shares = {name: share for name, share in run.saturated_shares.items() if share > 0.0}
    yield "at the limit", _listed(f"{name} {100.0 * s:.3g} %" for name, s in shares.items())
    if run.plan_errors:
        errors = (f"{error:.3g} m after {t:.3g} s" for t, error in run.plan_errors.items())
        yield "plans, off by", _listed(errors)
    if run.absent:
        yield "not recorded", ", ".join(run.absent)


def _times_line(times: dict[str, float]) -> str:
    shown = [
        f"{name.removesuffix('_us')} {1e-3 * times[name]:.4g} ms"
        for name in ("p50_us", "p99_us", "max_us")
        if name in times
    ]
    return ", ".join(shown)


def _listed(items: Iterable[str], separator: str = "\n") -> str:
    every = list(items)
    more = [f"... {len(every)} in all"] if len(every) > _MOST_LISTED else []
    return separator.join(every[:_MOST_LISTED] + more) or "none"


def _size(size: float) -> str:
    """A size in bytes with a unit."""
    unit = 0
    while size >= 1000.0 and unit < len(_SIZES) - 1:
        size, unit = size / 1000.0, unit + 1
    return f"{size:.3g} {_SIZES[unit]}"


def _finite(value: Any) -> Any:
    """The value as JSON can say it: an unknown or infinite number is null."""
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
