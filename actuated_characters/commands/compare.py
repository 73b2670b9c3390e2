"""The command `actuated_characters compare`: two recorded runs side by side."""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.report.comparison.comparison import Comparison

_DIFFERENT = 1  # exit code, like that of diff
_MOST_SECONDS = 20  # in the table
_HASH = "state_hash"
_SHOWN_OF_A_HASH = 12
_LONGEST_VALUE = 60  # characters


def add_compare(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    compare = commands.add_parser(
        "compare",
        help="compare two recorded runs",
        description=(
            "Compare two recorded runs of a character tick by tick: the first tick and degree of "
            "freedom that differ, how the difference grows, figures, parameters, versions. Exit "
            "code 0 if the states are identical, 1 if not."
        ),
        epilog="example: actuated_characters compare runs/demo runs/falls",
    )
    compare.set_defaults(command=_compare)
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
    from actuated_characters.bags.recording import read_recordings
    from actuated_characters.report.comparison.comparison import compare, pair

    pairs = pair(read_recordings(options.first), read_recordings(options.second))
    comparisons = [compare(first, second, tolerance) for first, second in pairs]
    console = Console()
    for comparison in comparisons:
        _print(console, comparison, tolerance)
    _print_differences(console, "versions", comparisons[0].versions)
    if output is not None:
        from actuated_characters.report.charts import png
        from actuated_characters.report.comparison.chart import draw_comparisons
        from actuated_characters.whole_files import write_whole

        write_whole(output, png(draw_comparisons(comparisons)))
        console.print(escape(str(output)), soft_wrap=True)
    return 0 if all(comparison.identical for comparison in comparisons) else _DIFFERENT


def _print(console: Console, comparison: "Comparison", tolerance: float | None) -> None:
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


def _verdict(comparison: "Comparison", tolerance: float | None) -> str:
    ours, theirs = comparison.states
    how = "to the last bit" if tolerance is None else f"within {tolerance:g}"
    same = "different" if comparison.first is not None else f"identical {how}"
    if ours == theirs == comparison.common:
        return f"{same}: {ours} states each"
    return (
        f"{same} in what both have: {comparison.common} states with the same stamps, of {ours} "
        f"and {theirs}"
    )


def _growth_table(comparison: "Comparison") -> Table:
    table = Table(title="largest difference in each second", title_justify="left")
    columns = ("from (s)", "joints (rad)", "sliders (m)", "root (m)")
    for column in columns:
        table.add_column(column, justify="right")
    rows = comparison.growth.by_second()
    stride = -(-len(rows) // _MOST_SECONDS)
    for row in rows[::stride]:
        table.add_row(f"{row[0]:g}", *(_number(value) for value in row[1:]))
    return table


def _figures_table(comparison: "Comparison") -> Table:
    table = Table(title="figures", title_justify="left")
    table.add_column("")
    for column in ("first", "second", "second - first"):
        table.add_column(column, justify="right")
    for name, (ours, theirs) in comparison.figures.items():
        numbers = all(isinstance(value, (int, float)) for value in (ours, theirs))
        flags = isinstance(ours, bool) or isinstance(theirs, bool)
        difference = ""
        if numbers and not flags:
            assert isinstance(ours, (int, float)) and isinstance(theirs, (int, float))
            difference = _number(theirs - ours)
        shown = [_figure(name, value) for value in (ours, theirs)]
        table.add_row(name, *shown, difference)
    return table


def _print_differences(
    console: Console, title: str, differences: Mapping[str, tuple[object, object]]
) -> None:
    if not differences:
        return
    table = Table(title=f"{title} that differ", title_justify="left")
    for column in ("", "first", "second"):
        table.add_column(column, overflow="fold")
    for name, values in differences.items():
        table.add_row(escape(name), *(escape(_short(value)) for value in values))
    console.print(table)


def _figure(name: str, value: object) -> str:
    if name == _HASH:
        return str(value)[:_SHOWN_OF_A_HASH]
    return _number(value) if isinstance(value, float) else str("-" if value is None else value)


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.6g}"


def _short(value: object) -> str:
    text = "-" if value is None else str(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}..."
