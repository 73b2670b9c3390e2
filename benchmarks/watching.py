"""What watching costs the loop: with a page that takes all pictures of a viewer, and without."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console

from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.processes import Child
from benchmarks.closed_loop import WALK
from benchmarks.support.nodes import Nodes, processor_time
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from msgs_config.messages import topics
from tests.support.browser import CHROMIUM, Browser
from tests.support.page_client import PageClient

_CHARACTER = "humanoid"
_DURATION = 3600.0  # s of simulated time, more than is needed
_PORT = 18080
_PAIRS = 4  # pairs of a time that is watched and one that is not, in one run
_REPORTS = 3  # reports of the simulator, one a second, in each time

Watching = Callable[[], AbstractContextManager[PageClient | None]]


@dataclass(frozen=True)
class WatchTiming:
    """What was measured between two reports of the simulator."""

    ticks_per_s: float
    share: float  # share of a core that the viewer had
    pictures_per_s: float = 0.0


def measure_watching(console: Console) -> list[Ratio]:
    """Measure and print the table; how much slower the loop is while it is watched."""
    title = f"watching, {_CHARACTER} in lockstep as fast as it goes, medians of {_PAIRS} pairs"
    heading = ("", "ticks/s", "watched", "slow-down", "pictures/s", "viewer's share of a core")
    table = make_table(title, heading)
    plan = make_plan(_CHARACTER, _DURATION, WALK, {}, {})
    ratios = []
    for label, composed in (("composed", True), ("two processes", False)):
        console.print(f"watching: {_CHARACTER}, {label} ...")
        for page, pairs in _measure(plan, composed=composed):
            without, watched = (_medians([pair[row] for pair in pairs]) for row in (0, 1))
            slow_downs = [one.ticks_per_s / other.ticks_per_s for one, other in pairs]
            slow_down = float(np.median(slow_downs))
            pictures = f"{watched.pictures_per_s:.0f}" if watched.pictures_per_s else ""
            table.add_row(
                f"{label}, {page}",
                f"{without.ticks_per_s:.0f}",
                f"{watched.ticks_per_s:.0f}",
                f"{slow_down:.2f} ({min(slow_downs):.2f} to {max(slow_downs):.2f})",
                pictures,
                f"{watched.share:.1%}",
            )
            if page == "headless client":
                name = f"watching, {label}"
                ratios.append(Ratio(name, slow_down, "a tick that is watched / one that is not"))
    console.print(table)
    return ratios


def _measure(
    plan: RunPlan, *, composed: bool
) -> Iterator[tuple[str, list[tuple[WatchTiming, WatchTiming]]]]:
    """Pairs of times, not watched and watched, for each kind of page."""
    with Nodes() as nodes:
        viewer = nodes.start(topics.VIEWER_NODE, {"port": _PORT})
        nodes.start_loop(plan.simulator, plan.controller, composed=composed)
        nodes.wait_until(lambda: nodes.tick > 1)
        yield "headless client", _pairs(nodes, viewer, partial(_client, nodes))
        if CHROMIUM:
            yield "Chromium", _pairs(nodes, viewer, partial(_browser, nodes))


@contextmanager
def _client(nodes: Nodes) -> Iterator[PageClient]:
    with PageClient(_PORT) as page:
        nodes.wait_until(lambda: page.pictures > 10)  # the whole scene has come
        yield page


@contextmanager
def _browser(nodes: Nodes) -> Iterator[None]:
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        closing(Browser(Path(folder))) as browser,
    ):
        browser.open(f"http://127.0.0.1:{_PORT}")
        begun = time.monotonic()
        nodes.wait_until(lambda: time.monotonic() > begun + 10.0)  # the browser has drawn a while
        yield None


def _pairs(
    nodes: Nodes, viewer: Child, watching: Watching
) -> list[tuple[WatchTiming, WatchTiming]]:
    pairs = []
    for _ in range(_PAIRS):
        timings = []
        for page in (nullcontext(), watching()):
            with page as client:
                timings.append(_time(nodes, viewer, client))
        pairs.append((timings[0], timings[1]))
    return pairs


def _time(nodes: Nodes, viewer: Child, page: PageClient | None) -> WatchTiming:
    """Measure from the next report to the one some reports later."""

    def count() -> tuple[float, float, float, int]:
        known = len(nodes.reports)
        nodes.wait_until(lambda: len(nodes.reports) > known)
        pictures = page.pictures if page is not None else 0
        return time.monotonic(), nodes.tick, processor_time(viewer.pid), pictures

    first = count()
    for _ in range(_REPORTS):
        last = count()
    taken, ticks, busy, pictures = (b - a for a, b in zip(first, last, strict=True))
    return WatchTiming(ticks / taken, busy / taken, pictures / taken)


def _medians(timings: list[WatchTiming]) -> WatchTiming:
    rows = [(each.ticks_per_s, each.share, each.pictures_per_s) for each in timings]
    return WatchTiming(*np.median(rows, axis=0).tolist())
