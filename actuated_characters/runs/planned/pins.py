"""Pins that are planned before a run, each with the stamp of the tick that it begins with."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.files import Planned, read_planned
from msgs_config.messages.clock import TickClock
from msgs_config.messages.pins import PinArrays
from sim_node.physics.pins import PinQueue


@dataclass(frozen=True)
class PlannedPin(Planned):
    """A point of a link that is held to a place from a stamp on, until the link's next one."""

    link: str
    place: tuple[float, float, float]  # m, world
    force: float  # N, the largest; 0 lets go
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, link frame

    def arrays(self, session: str) -> PinArrays:
        """The pin as the content of a message for the simulator of a session."""
        row = (*self.place, *self.point, self.force)
        return PinArrays.of_rows(self.stamp_ns, {self.link: row}, session)


def pin_schedule(plan: RunPlan, pins: Sequence[PlannedPin]) -> PinQueue:
    """The pins of a plan as its simulator takes them, without topics."""
    schedule, clock = PinQueue(plan.character), TickClock(plan.simulation.rate_hz)
    for pin in pins:
        content, first_tick = pin.arrays(""), clock.first_tick_from(pin.stamp_ns)
        arrays = content.places, content.points, content.forces
        schedule.add(content.links, *arrays, first_tick=first_tick)
    return schedule


def planned_pins(pins: PinArrays) -> list[PlannedPin]:
    """The pins of a message, one by one; it has places and points."""
    return [
        PlannedPin(pins.stamp_ns, link, (x, y, z), force, (px, py, pz))
        for link, (x, y, z, px, py, pz, force) in pins.rows.items()
    ]


def read_pins(file: Path) -> list[PlannedPin]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`.

    Equal files are of equal pins: a list of JSON becomes a tuple again.
    """
    return read_planned(
        file,
        "pins",
        lambda fields: PlannedPin(
            **{**fields, **{name: tuple(fields[name]) for name in ("place", "point")}}
        ),
    )
