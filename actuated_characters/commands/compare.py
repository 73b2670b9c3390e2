"""The command `actuated_characters compare`: two recorded runs side by side."""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.tables import make_table, show
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.report.comparison import RecordingComparison

_DIFFERENT = 1  # exit code, like that of diff
_MOST_SECONDS = 20  # seconds that the table has at the most
_HASH = "state_hash"
_SHOWN_OF_A_HASH = 12
_LONGEST_VALUE = 60  # characters of a value


def add_compare(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    compare = add_command(
        commands,
        _compare,
        "compare",
        "compare two recorded runs",
        "Compare two recorded runs of a character tick by tick: the first tick and degree of "
        "freedom that differ, how the difference grows, figures, parameters, versions. Exit code 0 "
        "if the states are identical, 1 if not.",
        ["compare runs/demo runs/falls"],
    )
    compare.add_argument("first", type=Path, metavar="BAG", help="a run's directory, or a bag")
    compare.add_argument("second", type=Path, metavar="BAG", help="another one")
    compare.add_argument(
        "--output", type=Path, metavar="FILE.png", help="draw how the difference grows"
    )
    compare.add_argument(
        "--tolerance",
        type=float,
        metavar="T",
        help="numbers that are so close count as the same: T rad, m, rad/s, m/s, N m or N, and of "
        "those larger than 1 the part T (to the last bit)",
    )


def _compare(options: argparse.Namespace) -> int:
    tolerance, output = options.tolerance, options.output
    if tolerance is not None and not 0.0 <= tolerance < math.inf:
        raise ConfigurationError(f"--tolerance is {tolerance}; it must be 0 or more")
    if output is not None and output.suffix.lower() != ".png":
        raise ConfigurationError(f"--output {output}: it must be a .png file")
    from actuated_characters.bags.whole import read_whole
    from actuated_characters.report.comparison import compare, pair

    pairs = pair(read_whole(options.first), read_whole(options.second))
    comparisons = [compare(first, second, tolerance) for first, second in pairs]
    console = Console()
    for comparison in comparisons:
        _print(console, comparison, tolerance)
    _print_differences(console, "versions", comparisons[0].versions)
    if output is not None:
        from actuated_characters.report.charts import png
        from actuated_characters.report.comparison import draw_comparisons
        from msgs_config.whole_files import write_whole

        write_whole(output, png(draw_comparisons(comparisons)))
        console.print(escape(str(output)), soft_wrap=True)
    return 0 if all(comparison.identical for comparison in comparisons) else _DIFFERENT


def _print(console: Console, comparison: "RecordingComparison", tolerance: float | None) -> None:
    named = f"{comparison.name}: " if comparison.name else ""
    console.print(escape(named + _verdict(comparison, tolerance)), soft_wrap=True)
    first = comparison.first
    if first is not None:
        others = f", and {first.count - 1} more" if first.count > 1 else ""
        ours, theirs = first.values
        of_tick = "effort of the tick before" if first.quantity == "effort" else first.quantity
        console.print(
            escape(
                f"first difference: tick {first.tick}, at {first.time:.6g} s, {of_tick} of "
                f"'{first.dof}'{others}: {ours!r} and {theirs!r}, {first.amount:.3g} apart"
            ),
            soft_wrap=True,
        )
        console.print(_growth_table(comparison))
    console.print(_figures_table(comparison))
    _print_differences(console, "parameters of sim_node", comparison.simulator)
    if comparison.controller is None:
        console.print("only one of them has a controller's parameters")
    else:
        _print_differences(console, "parameters of controller_node", comparison.controller)


def _verdict(comparison: "RecordingComparison", tolerance: float | None) -> str:
    ours, theirs = comparison.states
    how = "to the last bit" if tolerance is None else f"within {tolerance:g}"
    same = "different" if comparison.first is not None else f"identical {how}"
    if ours == theirs == comparison.common:
        return f"{same}: {ours} states each"
    return (
        f"{same} in what both have: {comparison.common} states with the same stamps, of {ours} "
        f"and {theirs}"
    )


def _growth_table(comparison: "RecordingComparison") -> Table:
    seconds = comparison.growth.by_second()
    stride = -(-len(seconds) // _MOST_SECONDS)
    return make_table(
        "largest difference in each second",
        ("from (s)", "joints (rad)", "sliders (m)", "root (m)"),
        [(f"{row[0]:g}", *(show(value, 6) for value in row[1:])) for row in seconds[::stride]],
    )


def _figures_table(comparison: "RecordingComparison") -> Table:
    rows = []
    for name, values in comparison.metrics.items():
        shown = [str(v)[:_SHOWN_OF_A_HASH] if name == _HASH else show(v, 6) for v in values]
        ours, theirs = (
            v if isinstance(v, (int, float)) and not isinstance(v, bool) else None for v in values
        )
        difference = "" if ours is None or theirs is None else show(float(theirs - ours), 6)
        rows.append((name, *shown, difference))
    return make_table("figures", ("", "first", "second", "second - first"), rows)


def _print_differences(
    console: Console, title: str, differences: Mapping[str, tuple[object, object]]
) -> None:
    if not differences:
        return
    rows = [(name, *map(_shorten, values)) for name, values in differences.items()]
    console.print(make_table(f"{title} that differ", ("", "first", "second"), rows, right=False))


def _shorten(value: object) -> str:
    text = "-" if value is None else str(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}..."
