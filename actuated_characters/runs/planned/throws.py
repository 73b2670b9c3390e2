"""Balls and boxes that are thrown at a link, planned before a run so that they hit it at a time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.files import Planned, read_planned
from actuated_characters.runs.planned.keyed_texts import ABOVE, bearing
from actuated_characters.runs.planned.throw_requests import ThrowRequest, parse_throw
from msgs_config.arrays import FloatArray
from msgs_config.errors import CommandError, ConfigurationError
from msgs_config.geometry import fixed_order
from msgs_config.messages.clock import TickClock
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.shared_parameters import PLANE
from sim_node.physics.balls.sphere_sweep import find_impact
from sim_node.physics.balls.throws import MOST_BALLS


@dataclass(frozen=True)
class PlannedThrow(Planned):
    """A ball or box that is let go in the state of a stamp."""

    throw: ProjectileThrow


def plan_throw(plan: RunPlan, request: ThrowRequest) -> tuple[PlannedThrow, tuple[str, ...]]:
    """A throw that hits a link, where the reference has it at that time, and the links in its way.

    It is let go as many whole ticks before as it needs for the straight way at its speed, and
    upwards by as much more as gravity takes away until then. What slides is let go on the ground,
    below the line to the link, and faster by as much as friction takes away.

    Raises:
        ConfigurationError: the link does not exist, the time is beyond the run or too early to
            arrive, it would touch the ground before, or tip over instead of sliding.
        CommandError: none like that can be thrown.
    """
    rate = plan.simulation.rate_hz
    end = plan.ticks / rate
    if not 0.0 <= request.at < end:
        raise ConfigurationError(f"at is {request.at:g} s; it must be 0 s to less than {end:g} s")
    position = plan.reference.sample(request.at).configuration.position
    angle, origin = bearing(plan.character, position, request.side)
    body = request.body(angle)
    slowing = _slowing(plan, request, body) if request.slide else 0.0
    impact = find_impact(
        plan.character,
        position,
        request.target,
        origin,
        body,
        request.distance,
        level=body.half_edges[2] if request.slide else None,
        engine=plan.simulation.world.engine,
    )
    way = request.distance - float(fixed_order.dot(impact.centre - impact.target, origin))
    at_first = math.sqrt(
        request.speed * request.speed + 2.0 * slowing * way
    )  # m/s: as fast as it has to start
    ticks = max(round(2.0 * way / (request.speed + at_first) * rate), 1)
    first = round(request.at * rate) - ticks
    if first < 0:
        raise ConfigurationError(
            f"at is {request.at:g} s; from {request.distance:g} m away at {request.speed:g} m/s "
            f"the {request.shape} needs {ticks / rate:.3g} s to '{request.target}': let it hit "
            "later, or come from nearer"
        )
    time, step = ticks / rate, 1.0 / (rate * plan.simulation.substeps)
    # the engine moves on with the velocity at the end of each of its steps
    start = impact.centre + (request.speed + 0.5 * slowing * (time - step)) * time * origin
    rise = 0.0 if request.slide else 0.5 * plan.simulation.world.gravity * (time + step)
    velocity = -(request.speed + slowing * time) * origin + np.array((0.0, 0.0, rise))
    if not request.slide:
        lowest = min(float(start[2]), float(impact.centre[2])) - body.half_edges[2]
        _check_ground(plan, request, body, lowest)
    throw = replace(body, position=_triple(start), velocity=_triple(velocity))
    return PlannedThrow(TickClock(rate).stamp_ns(1 + first), throw), impact.before


def _slowing(plan: RunPlan, request: ThrowRequest, body: ProjectileThrow) -> float:
    """By how much friction slows a box on the ground, m/s^2.

    Raises:
        ConfigurationError: there is no plane to slide on, or the box would tip over.
    """
    world = plan.simulation.world
    if plan.simulation.terrain != PLANE:
        raise ConfigurationError(
            f"slide: a box slides on the plane alone; the terrain is '{plan.simulation.terrain}'"
        )
    if request.side == ABOVE:
        raise ConfigurationError(f"slide: what comes from '{ABOVE}' cannot slide")
    friction = world.friction * world.link_friction
    length, _, height = body.half_edges
    if friction * height > length:
        raise ConfigurationError(
            f"slide: {body.describe()} would tip over: with friction {friction:.3g} it may be "
            f"{2.0 * length / friction:.3g} m high at most"
        )
    return friction * world.gravity


def _check_ground(
    plan: RunPlan, request: ThrowRequest, body: ProjectileThrow, lowest: float
) -> None:
    """Raise ConfigurationError if the lowest point of a body's way, m, is in the ground."""
    if plan.simulation.terrain == PLANE and lowest < 0.0:
        other = "a smaller 'radius'" if body.size is None else "a smaller 'size', slide=true"
        raise ConfigurationError(
            f"{body.describe()} on its way to '{request.target}' would be {-lowest:.2g} m in the "
            f"ground; take {other}, or another 'from'"
        )


def plan_throws(plan: RunPlan, texts: Sequence[str]) -> tuple[list[PlannedThrow], list[str]]:
    """The throws that texts describe, see `parse_throw`; and warnings.

    Raises:
        ConfigurationError: one of them cannot be; says which.
    """
    if len(texts) > MOST_BALLS:
        raise ConfigurationError(f"{len(texts)} throws; a run has at most {MOST_BALLS}")
    throws, warnings = [], []
    for text in texts:
        try:
            throw, before = plan_throw(plan, parse_throw(text))
        except (ConfigurationError, CommandError) as error:
            raise ConfigurationError(f"throw '{text}': {error}") from error
        throws.append(throw)
        if before:
            warnings.append(f"throw '{text}': {', '.join(before)} may be in its way")
    return throws, warnings


def read_throws(file: Path) -> list[PlannedThrow]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`."""

    def make(fields: Mapping[str, Any]) -> PlannedThrow:
        return PlannedThrow(fields["stamp_ns"], ProjectileThrow(**fields["throw"]))

    return read_planned(file, "throws", make)


def _triple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
