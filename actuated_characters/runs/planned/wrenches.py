"""Pushes that are planned before a run, each with the stamp of the tick that it begins with."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.files import Planned, read_planned
from actuated_characters.runs.planned.keyed_texts import (
    bearing,
    read_keys,
    read_number,
    read_side,
)
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages.clock import TickClock
from msgs_config.messages.wrenches import WrenchArrays
from sim_node.node_settings import NodeSettings
from sim_node.physics.wrenches import WrenchQueue

_EXAMPLE = "impulse=20 from=left at=1.5 target=chest"


@dataclass(frozen=True)
class PlannedPush(Planned):
    """A force and a torque on a link from a stamp on, for the simulator's `wrench_duration`."""

    link: str
    wrench: tuple[float, ...]  # (6,): force N, torque N m; world axes
    point: tuple[float, float, float] | None = None  # m, link frame; None: the centre of mass

    def arrays(self) -> WrenchArrays:
        """The push as a message's content."""
        points = [] if self.point is None else [self.point]
        return WrenchArrays.of_rows(self.stamp_ns, [self.link], [self.wrench], points)


def read_pushes(file: Path) -> list[PlannedPush]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`."""
    return read_planned(file, "pushes", lambda fields: PlannedPush(**fields))


def push_schedule(plan: RunPlan, pushes: Sequence[PlannedPush]) -> WrenchQueue:
    """The pushes of a plan as its simulator takes them, without topics."""
    schedule, clock = WrenchQueue(plan.character), TickClock(plan.simulation.rate_hz)
    for push in pushes:
        content = push.arrays()
        schedule.add(
            content.links,
            content.wrenches,
            content.points,
            first_tick=clock.first_tick_from(push.stamp_ns),
            ticks=NodeSettings.of(plan.simulator).push_ticks,
        )
    return schedule


def parse_push(text: str, plan: RunPlan) -> PlannedPush:
    """The push of a text.

    That is `LINK:FX,FY,FZ@S`, N in world axes and s since the first state, or
    `impulse=NS from=SIDE at=S target=LINK`: a horizontal impulse in N s, or one from above, from a
    side of the character as it faces in the reference at that time.

    Raises:
        ConfigurationError: the text is of neither form, or see `plan_push`.
    """
    return plan_push(plan, *_split(text, plan))


def parse_pushes_within(texts: Sequence[str], plan: RunPlan) -> list[PlannedPush]:
    """The pushes of texts, without those that would begin after the run.

    Raises:
        ConfigurationError: as `parse_push`.
    """
    rate = plan.simulation.rate_hz
    return [
        plan_push(plan, link, force, time)
        for link, force, time in (_split(text, plan) for text in texts)
        if not (math.isfinite(time) and round(time * rate) >= plan.ticks)
    ]


def _split(text: str, plan: RunPlan) -> tuple[str, tuple[float, float, float], float]:
    """Link, force and time of a text. Raises ConfigurationError if it is of another form."""
    if "=" in text:
        return _impulse(text, plan)
    found = re.fullmatch(r"(.+):([^,@]+),([^,@]+),([^,@]+)@([^,@]+)", text)
    try:
        if found is None:
            raise ValueError
        x, y, z, time = (float(number) for number in found.groups()[1:])
    except ValueError:
        raise ConfigurationError(
            f"push {text}: write it as LINK:FX,FY,FZ@S, such as chest:100,0,0@1.5, or as "
            f"'{_EXAMPLE}'"
        ) from None
    return found[1], (x, y, z), time


def _impulse(text: str, plan: RunPlan) -> tuple[str, tuple[float, float, float], float]:
    """Link, mean force and time of an impulse from a side."""
    try:
        given = read_keys(text, ("impulse", "at", "target"), ("from",), _EXAMPLE)
        impulse, time = (read_number(key, given[key]) for key in ("impulse", "at"))
        side = read_side(given.get("from", "front"))
    except ConfigurationError as error:
        raise ConfigurationError(f"push '{text}': {error}") from error
    position = plan.reference.sample(time).configuration.position
    _, origin = bearing(plan.character, position, side)
    seconds = NodeSettings.of(plan.simulator).push_ticks / plan.simulation.rate_hz
    x, y, z = (-impulse / seconds * origin).tolist()
    return given["target"], (x, y, z), time


def plan_push(
    plan: RunPlan, link: str, force: tuple[float, float, float], time: float
) -> PlannedPush:
    """A force (N, world axes) on a link's centre of mass, at a time in s since the first state.

    Raises:
        ConfigurationError: the link does not exist, a number is not finite, or the time is beyond
            the run.
    """
    links = [link.name for link in plan.character.links]
    rate = plan.simulation.rate_hz
    if link not in links:
        raise ConfigurationError(f"push: {one_of('link', link, links)}")
    if not all(math.isfinite(value) for value in force):
        raise ConfigurationError(f"push on '{link}': force is {force}; it must be finite")
    tick = round(time * rate) if math.isfinite(time) else -1
    if not 0 <= tick < plan.ticks:
        raise ConfigurationError(
            f"push on '{link}': time is {time} s; it must be 0 s to less than "
            f"{plan.ticks / rate:g} s"
        )
    return PlannedPush(TickClock(rate).stamp_ns(1 + tick), link, (*force, 0.0, 0.0, 0.0))
