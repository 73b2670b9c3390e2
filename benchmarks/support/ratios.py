"""Ratios of costs, compared with those that are stored: what got dearer, whatever the machine.

Both costs of a ratio are measured in one run, so that a slow machine makes both greater; less is
better. `ratios.yaml` beside this file holds the stored ones, and `python -m benchmarks --store`
renews them, on purpose and on a machine that does nothing else.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml
from rich.table import Table

from benchmarks.support.printed import make_table
from msgs_config.errors import ConfigurationError

RATIOS_FILE = Path(__file__).with_name("ratios.yaml")
TOLERANCE = 0.2
_HEADER = (
    "# Ratios of costs that were measured in one run each; less is better. `make bench` prints in\n"
    "# red what is more than 20 % above; `python -m benchmarks --store` renews those it measures.\n"
)


@dataclass(frozen=True)
class Ratio:
    """A cost over another one that was measured in the same run."""

    figure: str
    value: float
    how: str  # says which cost is over which


@dataclass(frozen=True)
class RatioComparison:
    """A ratio beside the stored one."""

    ratio: Ratio
    stored: float | None  # None: there is none yet

    @property
    def change(self) -> float | None:
        """By which share of the stored one it is above; below zero it is better."""
        return None if self.stored is None else self.ratio.value / self.stored - 1.0

    @property
    def is_worse(self) -> bool:
        """Whether it is worse by more than what measurements scatter by."""
        return self.change is not None and not self.change <= TOLERANCE  # NaN counts as worse, too


def compare(measured: Iterable[Ratio], stored: Mapping[str, float]) -> list[RatioComparison]:
    """Each measured ratio beside the stored one of the same figure."""
    return [RatioComparison(ratio, stored.get(ratio.figure)) for ratio in measured]


def comparison_table(comparisons: Iterable[RatioComparison]) -> Table:
    """A row for each ratio; red where it got worse."""
    title = "ratios, beside the stored ones; less is better"
    table = make_table(title, ("", "now", "stored", "change"))
    for each in comparisons:
        stored = "none" if each.stored is None else f"{each.stored:.3g}"
        change = "" if each.change is None else f"{100.0 * each.change:+.0f} %"
        row = (f"{each.ratio.figure}: {each.ratio.how}", f"{each.ratio.value:.3g}", stored, change)
        table.add_row(*row, style="bold red" if each.is_worse else "")
    return table


def read_ratios(path: Path = RATIOS_FILE) -> dict[str, float]:
    """The stored ratios by figure; none where there is no file yet.

    Raises:
        ConfigurationError: it is no such file, or a ratio is not a positive number.
    """
    if not path.exists():
        return {}
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    if not isinstance(content, dict):
        raise ConfigurationError(f"{path}: must be a mapping of figures")
    return {str(figure): _ratio(path, str(figure), entry) for figure, entry in content.items()}


def _ratio(path: Path, figure: str, entry: object) -> float:
    value = entry.get("ratio") if isinstance(entry, dict) else None
    if isinstance(value, int | float) and 0.0 < value < math.inf:
        return float(value)
    raise ConfigurationError(f"{path}: '{figure}': ratio is {value!r}; must be a positive number")


def store_ratios(measured: Iterable[Ratio], path: Path = RATIOS_FILE) -> None:
    """Store measured ratios in place of those of the same figures; others stay.

    Raises:
        ConfigurationError: the file that is there cannot be read.
    """
    read_ratios(path)
    known = yaml.safe_load(path.read_text(encoding="utf-8")) if path.exists() else {}
    new = {r.figure: {"ratio": float(f"{r.value:.4g}"), "how": r.how} for r in measured}
    text = yaml.safe_dump({**known, **new}, sort_keys=True, allow_unicode=True, width=1000)
    path.write_text(_HEADER + text, encoding="utf-8")
