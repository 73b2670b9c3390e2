"""Runs a search for a motion with its progress bar, and a page in the browser if that is wanted."""

import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.settings import CHARACTER
from actuated_characters.commands.common.tables import make_facts_table
from actuated_characters.reconstruction.reconstruction import Job, Reconstruction, reconstruct
from actuated_characters.reconstruction.search import Progress

if TYPE_CHECKING:  # its extra may not be installed
    from actuated_characters.viewer.search.page import SearchPage


def run_search(job: Job, viewer: Mapping[str, object] | None, about: str = "") -> None:
    """Search, report, and with parameters of a viewer show it until an interruption.

    `about` is Markdown for the page, in place of its own.

    Raises:
        ActuatedCharactersError: see `reconstruct`; or the page cannot be.
        KeyboardInterrupt: it was interrupted before the result was there.
    """
    title = f"{job.problem.character}: {job.problem.clip}"
    with ExitStack() as stack:
        page = None if viewer is None else stack.enter_context(_page(job, title, viewer, about))
        found = _search(job, title, page)
        _report(job, found)
        if page is not None:
            _show_result(page, found)


def _page(job: Job, title: str, viewer: Mapping[str, object], about: str) -> "SearchPage":
    from actuated_characters.commands.motion.search_news import wanted_news
    from actuated_characters.viewer.search.page import SearchPage
    from actuated_characters.viewer.search.player import Searched

    plan = job.problem.plan()
    page = SearchPage(Searched(plan.character, title, plan.simulation.rate_hz, about), viewer)
    for line in page.lines:
        print(f"watch it at {line}", flush=True)
    page.show(wanted_news(plan))
    return page


def _search(job: Job, title: str, page: "SearchPage | None") -> Reconstruction:
    """Search with a bar, and tell the page of each window."""
    plan = job.problem.plan()
    with progress_bar(title, 1, "windows") as bar:

        def report(progress: Progress, windows: int) -> None:
            state = f"best cost {progress.levels[-1][0].cost:.3g}" if progress.levels else ""
            task = bar.task_ids[0]
            bar.update(task, completed=progress.window, total=windows, state=state)
            if page is not None and progress.tried:
                from actuated_characters.commands.motion.search_news import window_news

                page.show(window_news(plan, progress, windows))

        return reconstruct(job, report)


def _show_result(page: "SearchPage", found: Reconstruction) -> None:
    """Show what was found until an interruption."""
    from actuated_characters.commands.motion.search_news import found_news

    page.show(found_news(found))
    say("the page shows it until Ctrl-C")
    try:
        page.wait()
    except KeyboardInterrupt:
        return


def _report(job: Job, found: Reconstruction) -> None:
    """Print the figures, and the command that plays the file."""
    metrics = found.metrics
    facts = {
        "length": f"{job.problem.duration:g} s, {metrics.ticks} ticks, {found.windows} windows",
        "centre of mass error, mean": f"{metrics.centre_error_mean_m:.3f} m",
        "joint error, mean": f"{metrics.joint_error_mean_rad:.3f} rad",
        "lowest root": f"{metrics.least_root_height_m:.3f} m",
        "fell": str(metrics.fell),
        "state_hash": metrics.state_hash,
    }
    console = Console()
    console.print(make_facts_table(str(job.output), facts.items()))
    command = f"actuated_characters run --clip {shlex.quote(str(job.output))}"
    if job.problem.character != CHARACTER:
        command += f" --character {shlex.quote(job.problem.character)}"
    console.print("play it over topics:", command, soft_wrap=True, markup=False)
