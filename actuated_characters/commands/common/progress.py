"""The progress bars of the commands."""

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


def progress_bar(
    description: str, total: float, unit: str = "", *, transient: bool = False
) -> Progress:
    """A bar on standard error with one task, of so many units; a transient one leaves no trace.

    The task's field `state` is shown beside it.
    """
    console = Console(stderr=True)
    count = [TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {unit}")] if unit else []
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        *count,
        TextColumn("{task.fields[state]}", markup=False),
        TimeRemainingColumn(),
        console=console,
        transient=transient,
        disable=transient and not console.is_interactive,  # else the bar would leave an empty line
    )
    bar.add_task(description, total=total, state="")
    return bar


def say(text: str) -> None:
    """Print a line on standard error, as it is."""
    Console(stderr=True).print(text, soft_wrap=True, markup=False, highlight=False)
