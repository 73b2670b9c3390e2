"""The list of what `--set` can set, with the values of a run."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.padding import Padding

from actuated_characters.commands.common.settings import parameters_of

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.runs.plan import RunPlan


def print_parameters(node: str, plan: "RunPlan", recording: Mapping[str, object]) -> None:
    """Print a node's parameters with their values in a run, and the default where that is another.

    Args:
        node: A node's name; see `parameters_of`.
        plan: The plan of the run.
        recording: The recorder's parameters that are given, by name.
    """
    console = Console(highlight=False)
    values = {"sim_node": plan.simulator, "controller_node": plan.controller}.get(node, recording)
    for parameter in parameters_of(node, plan.character):
        default = _shortened(parameter.default)
        value = _shortened(values.get(parameter.name, parameter.default))
        else_default = f", by default {default or 'empty'}" if value != default else ""
        value = f"{value} {parameter.unit}".rstrip() + else_default
        choices = f": {' | '.join(parameter.choices)}" if parameter.choices else ""
        change = f" ({parameter.when_changed})" if parameter.when_changed else ""
        about = f"{parameter.description}{choices}{change}"
        if console.is_terminal:
            console.print(f"[bold]{escape(parameter.name)}[/bold]: {escape(value)}")
            console.print(Padding(escape(about), (0, 0, 0, 4)))
        else:  # a line for each parameter, so that they can be searched
            print(f"{parameter.name}: {value}  {about}")


def _shortened(value: object) -> str:
    """A value as a table shows it; a long list by its first entries."""
    if isinstance(value, list):
        shown = ", ".join(f"{item:g}" if isinstance(item, float) else item for item in value[:3])
        return f"[{shown}, ... {len(value)} in all]" if len(value) > 3 else f"[{shown}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
