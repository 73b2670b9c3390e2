"""Simulations of the labs: a character, and a law that asks the student's functions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from actuated_characters.api import Simulation
from lecture.labs.sheet import Sheet
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character, Link
from msgs_config.errors import SimulationError
from msgs_config.messages.state import StampedState
from sim_node.physics.settings import STEADY_CONTACTS

RATE = 240  # Hz
PERIOD = 1.0 / RATE
# an engine that is there on every Python
ENGINE = {"engine": "mujoco", "rate": RATE, **STEADY_CONTACTS}


Law = Callable[[int, StampedState, FloatArray | None], FloatArray]
"""The efforts (n,) of a tick: its number, the state, and contact wrenches (links, 6) if watched."""


@dataclass(frozen=True)
class Push:
    """A force (3,) in N, world axes, on a link."""

    link: str
    force: tuple[float, float, float]


@dataclass(frozen=True)
class Trace:
    """What became of a simulation."""

    position: FloatArray  # (t + 1, n)
    velocity: FloatArray  # (t + 1, n)
    has_diverged: bool


def simulate(
    sheet: Sheet,
    character: Character,
    ticks: int,
    law: Law,
    *,
    start: StampedState | None = None,
    pushes: Mapping[int, Push] = MappingProxyType({}),
    goes_on: Callable[[StampedState], bool] = lambda state: True,
    watch_contacts: bool = False,
    **parameters: object,
) -> Trace:
    """Simulate ticks while `goes_on`; the states are in the sheet's hash.

    Raises:
        StudentError: the law has met one.
    """
    states: list[StampedState] = []
    diverged = False
    given = {**ENGINE, **parameters}
    with Simulation(character, start, given, watch_contacts=watch_contacts) as simulation:
        states.append(simulation.state)
        for tick in range(ticks):
            if tick in pushes:
                simulation.push(pushes[tick].link, pushes[tick].force)
            contacts = simulation.contacts if watch_contacts else None
            effort = law(tick, simulation.state, contacts)
            try:
                states.append(simulation.step(effort))
            except SimulationError:
                diverged = True
                break
            if not goes_on(simulation.state):
                break
        sheet.hashes.append(simulation.state_hash)
    return Trace(
        np.array([state.position for state in states]),
        np.array([state.velocity for state in states]),
        diverged,
    )


def heavier(character: Character, factor: float) -> Character:
    """A character whose links have so many times their masses and inertias."""
    return replace(character, links=tuple(_heavier(link, factor) for link in character.links))


def _heavier(link: Link, factor: float) -> Link:
    x, y, z = link.inertia_diagonal
    inertia = (factor * x, factor * y, factor * z)
    return replace(link, mass=factor * link.mass, inertia_diagonal=inertia)
