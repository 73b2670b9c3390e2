"""The command `actuated_characters take`: what was edited of a timeline, simulated."""

import argparse
import time
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.tables import make_table

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.timeline.takes import Take, Takes
    from actuated_characters.timeline.taking import PlannedTake

_ABOUT = (
    "Simulate a timeline as its file is now, and keep the recorded run as a take beside the file: "
    "of dance.yaml in dance.takes/1, 2, ... Of a file that was edited since the take before, only "
    "what the edit can change is simulated, from the last keyframe before it on; all states are "
    "those of a whole run, bit for bit. A take is a run: view, render, export, compare and fork "
    "take its folder."
)


def add_take(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    take = add_command(
        commands,
        _take,
        "take",
        "simulate what was edited of a timeline",
        _ABOUT,
        ["take dance.yaml --title 'the arm is higher'", "take dance.yaml --list"],
    )
    take.add_argument("file", metavar="FILE", help="a timeline: a shipped name or a .yaml file")
    origin = take.add_mutually_exclusive_group()
    origin.add_argument("--of", metavar="N", help="go on from this take (the last one)")
    origin.add_argument(
        "--from-start", action="store_true", help="go on from none: simulate all of it"
    )
    take.add_argument("--title", default="", metavar="TEXT", help="what is said of it in the list")
    take.add_argument(
        "--progress", action="store_true", help="say how far it is in lines, as for programs"
    )
    take.add_argument("--list", action="store_true", help="list the takes there are, and end")


def _take(options: argparse.Namespace) -> None:
    from actuated_characters.timeline.takes import takes_of
    from actuated_characters.timeline.taking import make_take, plan_take

    takes = takes_of(options.file)
    if options.list:
        Console().print(_table(takes))
        return
    parent = None if options.from_start else _parent(takes, options.of)
    planned = plan_take(options.file, takes, parent)
    for warning in planned.run.warnings:
        print(warning)
    if planned.is_as_before:
        assert parent is not None
        print(f"nothing has changed: take {parent.name} is of this file (--from-start: once more)")
        return
    check_interruption()  # all modules are imported by now
    begun = time.monotonic()
    if options.progress:
        take = make_take(planned, options.title, partial(_say_progress, planned))
    else:
        take = _make_with_bar(planned, options)
    _report(planned, take, time.monotonic() - begun)


def _say_progress(planned: "PlannedTake", at: float) -> None:
    print(f"simulated {min(at, planned.until):.2f} of {planned.until:g} s", flush=True)


def _make_with_bar(planned: "PlannedTake", options: argparse.Namespace) -> "Take":
    from actuated_characters.timeline.taking import make_take

    length = planned.until - planned.begin
    with progress_bar(f"{options.file}: take", length, "s") as bar:

        def progress(at: float) -> None:
            done = min(max(at - planned.begin, 0.0), length)
            bar.update(bar.task_ids[0], completed=done)

        take = make_take(planned, options.title, progress)
        progress(planned.until)
    return take


def _parent(takes: "Takes", name: str | None) -> "Take | None":
    """The take to go on from: of that number, else the last one; None if there are none."""
    if name is not None:
        return takes.find(name)
    present = takes.all()
    return present[-1] if present else None


def _report(planned: "PlannedTake", take: "Take", wall_time: float) -> None:
    from actuated_characters.recorder.run_directory import read_metrics

    if planned.parent is None:
        print(f"take {take.name}: {take.until:g} s from the beginning, in {wall_time:.1f} s")
    else:
        print(
            f"take {take.name}, of take {take.parent}: the same up to {take.since:.3f} s, "
            f"simulated from the keyframe at {take.begin:g} s on, in {wall_time:.1f} s"
        )
    summary = read_metrics(take.directory)[0]
    if summary.get("fell"):
        print(f"it falls at {take.begin + summary['fell_at_s']:.2f} s")
    print(f"look at it: actuated_characters view {take.directory}")


def _table(takes: "Takes") -> object:
    """The tree of takes, each below the one that it goes on from."""
    present = takes.all()
    names = {take.name for take in present}
    rows: list[tuple[str, ...]] = []

    def add(parent: str, depth: int) -> None:
        for take in present:
            root = "" if take.parent not in names else take.parent
            if root == parent:
                begin = f"{take.begin:g} to {take.until:g} s"
                since = f"{take.since:.3f} s" if take.parent else "-"
                rows.append(("  " * depth + take.name, since, begin, take.title))
                add(take.name, depth + 1)

    add("", 0)
    columns = ("take", "differs from", "simulated", "title")
    return make_table(f"takes in {takes.directory}", columns, rows, right=False)
