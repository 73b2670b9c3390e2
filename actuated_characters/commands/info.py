"""The command `actuated_characters info`: what is in a bag."""

import argparse
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.report.facts import BagFacts, RunFacts, StreamFacts

_MOST_LISTED = 12  # of gaps, pauses, episodes, pushes and changes; --json has all
_NS_PER_S = 10**9
_SIZES = ("B", "kB", "MB", "GB")


def add_info(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    info = commands.add_parser(
        "info",
        help="say what is in a bag",
        description=(
            "Say what is in a bag: files, topics with rates and gaps; and of each character ticks, "
            "missing and late ones, episodes, pauses, gains in force, pushes, saturation. Of a bag "
            "of something else, the topics."
        ),
        epilog="example: actuated_characters info runs/demo",
    )
    info.set_defaults(command=_info)
    info.add_argument("bag", type=Path, metavar="BAG", help="a run's directory, or a bag")
    info.add_argument("--json", action="store_true", help="print all of it as JSON")


def _info(options: argparse.Namespace) -> None:
    from actuated_characters.report.facts import as_json, look_at

    facts = look_at(options.bag)
    if options.json:
        print(as_json(facts))
        return
    console = Console()
    console.print(_bag_table(facts))
    console.print(_topics_table(facts))
    runs = {run.name: run for run in facts.runs}
    for stream in facts.streams:
        if stream.rate_hz is not None:
            console.print(_character_table(stream, runs.get(stream.name)))
    for run in facts.runs:
        if run.gains:
            console.print(_gains_table(run))
    if facts.lacks is not None:
        console.print(f"no more than that: {escape(facts.lacks)}", soft_wrap=True)


def _bag_table(facts: "BagFacts") -> Table:
    from actuated_characters.report.facts import longest_sim_time

    contents = facts.contents
    table = _facts_table(str(contents.bag))
    total = _size(sum(contents.files.values()))
    files = ", ".join(f"{name} ({_size(size)})" for name, size in contents.files.items())
    table.add_row("files", escape(f"{total}: {files}"))
    version = "unknown" if contents.version is None else str(contents.version)
    table.add_row(
        "storage",
        escape(
            f"{contents.storage}, compression {contents.compression}, metadata version {version}, "
            f"written by {contents.ros_distro}"
        ),
    )
    if contents.start_ns is not None:
        start = datetime.fromtimestamp(contents.start_ns // _NS_PER_S, tz=UTC)
        table.add_row("begun", start.strftime("%Y-%m-%d %H:%M:%S UTC"))
    table.add_row("wall time", f"{contents.wall_time:.6g} s")
    sim_time = longest_sim_time(facts)
    table.add_row("simulated time", "unknown" if sim_time is None else f"{sim_time:.6g} s")
    return table


def _topics_table(facts: "BagFacts") -> Table:
    from actuated_characters.report.facts import longest_sim_time

    sim_time = longest_sim_time(facts)
    table = Table(title="topics, with the largest gap", title_justify="left")
    table.add_column("name and type", overflow="fold")
    for column in ("count", "per s", "per sim. s", "gap (s)"):
        table.add_column(column, justify="right")
    for topic in facts.contents.topics:
        table.add_row(
            f"{escape(topic.name)}\n  [dim]{escape(topic.type_name)}[/dim]",
            str(topic.count),
            "-" if topic.rate_hz is None else f"{topic.rate_hz:.4g}",
            f"{topic.count / sim_time:.4g}" if sim_time else "-",
            f"{topic.largest_gap_ns / _NS_PER_S:.4g}" if topic.count > 1 else "-",
        )
    return table


def _character_table(stream: "StreamFacts", run: "RunFacts | None") -> Table:
    named = f"{stream.name}: " if stream.name else ""
    table = _facts_table(f"{named}{stream.character or 'unknown'}")
    table.add_row("character", escape(_character_line(stream)))
    if stream.ticks is not None:
        again = f", {stream.repeated} published again" if stream.repeated else ""
        time = f", {stream.sim_time:.6g} s" if stream.sim_time is not None else ""
        table.add_row("ticks", f"{stream.ticks}{time}{again}")
        table.add_row("missing ticks", _missing_line(stream))
    if stream.tick_us:
        table.add_row("from tick to tick", _times_line(stream.tick_us))
    if stream.late:
        count = int(stream.late["ticks"])
        times = _times_line(stream.late)
        lateness = f"; lateness {times}, pauses left out" if times else ""
        table.add_row("late ticks", f"{count} by more than a period{lateness}")
    table.add_row(
        "pauses",
        _listed(f"{p.duration:.3g} s of wall time at {p.start:.4g} s" for p in stream.pauses),
    )
    if run is not None:
        _add_run(table, run)
    if stream.versions:
        table.add_row("versions", escape(", ".join(map(" ".join, stream.versions.items()))))
    return table


def _add_run(table: Table, run: "RunFacts") -> None:
    table.add_row(
        "episodes", _listed(f"{e.duration:.4g} s from {e.start:.4g} s on" for e in run.episodes)
    )
    table.add_row("resets", str(run.resets))
    table.add_row("law", escape(run.law or "not recorded"))
    changes = (f"{c.name}: {c.before} to {c.after} after {c.time:.4g} s" for c in run.changes)
    table.add_row("changed meanwhile", _listed(changes))
    pushes = (
        f"{push.link} at {push.start:.4g} s for {push.duration:.3g} s: up to "
        f"{push.largest_force:.4g} N, {push.impulse:.4g} N s"
        for push in run.pushes
    )
    table.add_row("pushes", _listed(pushes) if run.pushes_recorded else "not recorded")
    from actuated_characters.report.reactions import mode_line, thrown_line

    thrown = (f"at {throw.start:.4g} s: {thrown_line(throw)}" for throw in run.throws)
    table.add_row("throws", _listed(thrown))
    modes = (f"at {span.start:.4g} s: {mode_line(span)}" for span in run.modes)
    table.add_row("modes", _listed(modes))
    shares = {name: share for name, share in run.saturated_shares.items() if share > 0.0}
    table.add_row("at the limit", _listed(f"{n} {100.0 * s:.3g} %" for n, s in shares.items()))
    absent = [
        what
        for what, there in (("reference", run.reference), ("contacts", run.contacts))
        if not there
    ]
    if absent:
        table.add_row("not recorded", ", ".join(absent))


def _gains_table(run: "RunFacts") -> Table:
    title = "gains and limits in force at the start"
    table = Table(title=f"{escape(run.name)}: {title}" if run.name else title, title_justify="left")
    table.add_column("joint")
    for column in ("p", "d", "i", "limit"):
        table.add_column(column, justify="right")
    for row in run.gains:
        values = (row.p, row.d, row.i, row.limit)
        shown = ["-" if value is None else f"{value:g}" for value in values]
        table.add_row(escape(row.joint), *shown)
    return table


def _facts_table(title: str) -> Table:
    table = Table(title=escape(title), title_justify="left", show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    return table


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
    return escape(separator.join(every[:_MOST_LISTED] + more)) or "none"


def _size(size: float) -> str:
    """A size in bytes, for people."""
    unit = 0
    while size >= 1000.0 and unit < len(_SIZES) - 1:
        size, unit = size / 1000.0, unit + 1
    return f"{size:.3g} {_SIZES[unit]}"
