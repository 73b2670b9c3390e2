"""What a soak has found, and how it is told."""

from collections import Counter
from dataclasses import dataclass, field

from rich.table import Table

SETTLED = 10_000  # ticks after which memory must not grow
MEMORY_PERIOD = 5_000  # ticks between looks at the memory


@dataclass
class SoakReport:
    """What a soak has found; it has passed if there are no problems."""

    ticks: int = 0
    wall_time: float = 0.0  # s
    repeated_states: int = 0
    disturbances: Counter[str] = field(default_factory=Counter)
    megabytes: dict[str, list[float]] = field(default_factory=dict)  # MB, a process's samples
    report: dict[str, str] = field(default_factory=dict)  # the simulator's last one
    problems: list[str] = field(default_factory=list)

    @property
    def growth(self) -> dict[str, float]:
        """MB that each process has grown by, at the most, since it had settled."""
        settled = SETTLED // MEMORY_PERIOD
        return {
            name: max(samples[settled:], default=0.0) - samples[settled]
            for name, samples in self.megabytes.items()
            if len(samples) > settled
        }

    def table(self) -> Table:
        """Everything that was found, for people to read."""
        table = Table(title="soak", title_justify="left", show_header=False)
        rate = self.ticks / self.wall_time
        table.add_row("ticks", f"{self.ticks} in {self.wall_time:.0f} s, {rate:.0f} a second")
        table.add_row("states that came twice", str(self.repeated_states))
        for name, count in sorted(self.disturbances.items()):
            table.add_row(name, str(count))
        for name, samples in self.megabytes.items():
            growth = self.growth.get(name)
            grown = "" if growth is None else f", grown by {growth:.2f} MB since it had settled"
            table.add_row(f"memory of {name}", f"{samples[-1]:.1f} MB{grown}")
        for key in ("accepted", "duplicate", "stale", "tick_us_p50", "tick_us_p99"):
            table.add_row(key, self.report.get(key, "?"))
        table.add_row("problems", str(len(self.problems)))
        return table
