"""The command `actuated_characters info`: the contents of a bag."""

import argparse
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from actuated_characters.commands.common.recovering import recover_bag
from actuated_characters.commands.common.settings import Commands, add_bag, add_command
from actuated_characters.commands.common.tables import make_facts_table, make_table

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.report.facts import BagFacts, RunFacts, StreamFacts

_MOST_LISTED = 12  # gaps, pauses, episodes, pushes and changes of each kind; --json has all
_NS_PER_S = 10**9
_SIZES = ("B", "kB", "MB", "GB")


def add_info(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    info = add_command(
        commands,
        _info,
        "info",
        "say what is in a bag",
        "Say what is in a bag: files, topics with rates and gaps; and of each character ticks, "
        "missing and late ones, episodes, pauses, gains in force, pushes, saturation. Of a bag of "
        "something else, the topics.",
        ["info runs/demo"],
    )
    add_bag(info)
    info.add_argument("--json", action="store_true", help="print all of it as JSON")
    info.add_argument(
        "--recover",
        action="store_true",
        help="first make the bag complete, where its recorder was killed, the disk was full or a "
        "copy broke off; the old one is kept beside it as BAG.damaged, and a run gets the figures "
        "that it lacks. A complete bag is not touched",
    )


def _info(options: argparse.Namespace) -> None:
    from actuated_characters.report.facts import as_json, look_at

    if options.recover:
        recover_bag(options.bag)
    facts = look_at(options.bag)
    if options.json:
        print(as_json(facts))
        return
    console = Console()
    console.print(make_facts_table(str(facts.contents.bag), _bag_rows(facts)))
    console.print(_topics_table(facts))
    runs = {run.name: run for run in facts.runs}
    for stream in facts.streams:
        if stream.rate_hz is not None:
            console.print(_character_table(stream, runs.get(stream.name)))
    for run in facts.runs:
        if run.gains:
            console.print(_gains_table(run))
    if facts.lacks is not None:
        console.print(f"no more than that: {facts.lacks}", soft_wrap=True, markup=False)


def _bag_rows(facts: "BagFacts") -> Iterator[tuple[str, str]]:
    from actuated_characters.report.facts import longest_sim_time

    contents = facts.contents
    files = ", ".join(f"{name} ({_size(size)})" for name, size in contents.files.items())
    yield "files", f"{_size(sum(contents.files.values()))}: {files}"
    version = "unknown" if contents.version is None else str(contents.version)
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
    wall_time = contents.wall_time
    unknown = "unknown, log times are simulated and SQLite has no others"
    yield "wall time", unknown if wall_time is None else f"{wall_time:.6g} s"
    sim_time = longest_sim_time(facts)
    yield "simulated time", "unknown" if sim_time is None else f"{sim_time:.6g} s"


def _topics_table(facts: "BagFacts") -> Table:
    from actuated_characters.report.facts import longest_sim_time

    sim_time = longest_sim_time(facts)
    rows = [
        (
            Text.assemble(topic.name, "\n  ", (topic.type_name, "dim")),
            topic.count,
            "-" if topic.rate_hz is None else f"{topic.rate_hz:.4g}",
            f"{topic.count / sim_time:.4g}" if sim_time else "-",
            "-" if topic.largest_gap is None else f"{topic.largest_gap:.4g}",
        )
        for topic in facts.contents.topics
    ]
    columns = ("name and type", "count", "per s", "per sim. s", "gap (s)")
    return make_table("topics, with the largest gap", columns, rows)


def _character_table(stream: "StreamFacts", run: "RunFacts | None") -> Table:
    named = f"{stream.name}: " if stream.name else ""
    rows = [*_stream_rows(stream), *(() if run is None else _run_rows(run))]
    if stream.versions:
        rows.append(("versions", ", ".join(map(" ".join, stream.versions.items()))))
    return make_facts_table(f"{named}{stream.character or 'unknown'}", rows)


def _stream_rows(stream: "StreamFacts") -> Iterator[tuple[str, str]]:
    """A character's states: how many, when, and which are missing."""
    yield "character", _character_line(stream)
    if stream.ticks is not None:
        again = f", {stream.repeated} published again" if stream.repeated else ""
        time = f", {stream.sim_time:.6g} s" if stream.sim_time is not None else ""
        yield "ticks", f"{stream.ticks}{time}{again}"
        yield "missing ticks", _missing_line(stream)
    if stream.tick_us:
        yield "from tick to tick", _times_line(stream.tick_us)
    if stream.late:
        times = _times_line(stream.late)
        lateness = f"; lateness {times}, pauses left out" if times else ""
        yield "late ticks", f"{int(stream.late['ticks'])} by more than a period{lateness}"
    pauses = (f"{p.duration:.3g} s of wall time at {p.start:.4g} s" for p in stream.pauses)
    yield "pauses", _listed(pauses)


def _run_rows(run: "RunFacts") -> Iterator[tuple[str, str]]:
    """A character's run: episodes, law, and what acted on it."""
    from actuated_characters.report.reactions import mode_line, thrown_line

    episodes = (f"{e.duration:.4g} s from {e.start:.4g} s on" for e in run.episodes)
    yield "episodes", _listed(episodes)
    yield "resets", str(run.resets)
    yield "law", run.law or "not recorded"
    changes = (f"{c.line} after {c.time:.4g} s" for c in run.changes)
    yield "changed meanwhile", _listed(changes)
    pushes = (
        f"{push.link} at {push.start:.4g} s for {push.duration:.3g} s: up to "
        f"{push.largest_force:.4g} N, {push.impulse:.4g} N s"
        for push in run.pushes
    )
    yield "pushes", _listed(pushes) if run.pushes_recorded else "not recorded"
    yield "throws", _listed(f"at {each.start:.4g} s: {thrown_line(each)}" for each in run.throws)
    yield "modes", _listed(f"at {span.start:.4g} s: {mode_line(span)}" for span in run.modes)
    shares = {name: share for name, share in run.saturated_shares.items() if share > 0.0}
    yield "at the limit", _listed(f"{n} {100.0 * s:.3g} %" for n, s in shares.items())
    recorded = {"reference": run.reference, "contacts": run.contacts}
    absent = [topic for topic, is_there in recorded.items() if not is_there]
    if absent:
        yield "not recorded", ", ".join(absent)


def _gains_table(run: "RunFacts") -> Table:
    title = "gains and limits in force at the start"
    rows = [
        (row.joint, *("-" if v is None else f"{v:g}" for v in (row.p, row.d, row.i, row.limit)))
        for row in run.gains
    ]
    columns = ("joint", "p", "d", "i", "limit")
    return make_table(f"{run.name}: {title}" if run.name else title, columns, rows)


def _character_line(stream: "StreamFacts") -> str:
    parts = [stream.character or "unknown"]
    if stream.degrees_of_freedom is not None:
        parts.append(f"{stream.degrees_of_freedom} degrees of freedom")
    if stream.mass is not None:
        parts.append(f"{stream.mass:.4g} kg")
    return ", ".join([*parts, f"{stream.rate_hz} Hz", stream.mode or "mode unknown"])


def _missing_line(stream: "StreamFacts") -> str:
    if not stream.missing:
        return "none"
    gaps = (str(a) if a == b else f"{a} to {b}" for a, b in stream.missing)
    return f"{stream.missing_count}: {_listed(gaps, separator=', ')}"


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
