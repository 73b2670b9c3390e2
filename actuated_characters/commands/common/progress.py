"""The progress bars of the sub-commands."""

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


def progress_bar(description: str, total: int, unit: str, *, transient: bool = False) -> Progress:
    """A bar on standard error with one task, of so many units; a transient one leaves no trace."""
    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {unit}"),
        TimeRemainingColumn(),
        console=console,
        transient=transient,
        disable=transient and not console.is_interactive,  # else it would leave an empty line
    )
    bar.add_task(description, total=total)
    return bar


def search_bar() -> Progress:
    """A bar on standard error whose tasks say in a field `state` how well it goes."""
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f}"),
        TextColumn("{task.fields[state]}", markup=False),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
