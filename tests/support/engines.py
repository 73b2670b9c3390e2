"""The engines that are installed, and PyBullet itself for the tests that ask it.

Where it is not installed, those are skipped; all others run, too, with the engine that is there.
"""

import gc
import math
from typing import Any, NoReturn

import numpy as np
import pytest

from sim_node.physics.engine import ENGINES, INSTALLED_ENGINES
from sim_node.physics.mujoco.body import MujocoBody
from sim_node.physics.mujoco.world import MujocoWorld
from sim_node.physics.simulation import Simulation

BULLET_IS_INSTALLED = "bullet" in INSTALLED_ENGINES
NOT_INSTALLED = "it asks PyBullet itself, which is not installed"
STANDS_IN = "pybullet is not installed, so the engine is mujoco"
"""How a line ends that says which engine stands in for the preferred one."""
needs_bullet = pytest.mark.skipif(not BULLET_IS_INSTALLED, reason=NOT_INSTALLED)
"""For what is about Bullet without asking it: its numbers, recordings of it."""


class _Missing:
    """Whoever asks it for anything is skipped."""

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)  # pytest's and doctest's own looks at a module
        pytest.skip(NOT_INSTALLED, allow_module_level=True)

    def __call__(self, *arguments: object) -> NoReturn:
        pytest.skip(NOT_INSTALLED, allow_module_level=True)


if BULLET_IS_INSTALLED:
    from sim_node.physics.bullet import client

    pybullet, Engine, load_urdf = client.pybullet, client.Engine, client.load_urdf
else:
    pybullet = Engine = load_urdf = _Missing()


def need_engine(name: str) -> None:
    """Skip the test, or the whole file, that calls it where an engine is not installed."""
    if name not in INSTALLED_ENGINES:
        pytest.skip(f"{ENGINES[name].package} is not installed", allow_module_level=True)


def links_at_ball(run: Simulation, row: int, least_force: float = -math.inf) -> frozenset[str]:
    """The links of the first character that a ball touches, by the engine's own list of contacts.

    `row` is the ball's place in the order of throws; what presses by no more than `least_force`, N,
    does not count.
    """
    body: Any = run.characters[0]._body
    balls: Any = run._world.balls
    links = [link.name for link in run.characters[0].character.links]
    if isinstance(body, MujocoBody):
        model, data = body._world.model, body._world.data
        ball, first = balls.balls[row].place.links.start, body.place.links.start
        bodies = model.geom_bodyid[data.contact.geom]
        rows = data.contact.efc_address  # -1: it is near, and presses by nothing
        forces = np.append(data.efc_force, 0.0)[rows]
        of_ball = (bodies == ball).any(axis=1) & (forces > least_force)
        others = bodies[of_ball].sum(axis=1) - ball - first
        return frozenset(links[other] for other in others if 0 <= other < len(links))
    points = pybullet.getContactPoints(balls.numbers[row], body._body, physicsClientId=body._client)
    return frozenset(links[body._row[point[4]]] for point in points if point[9] > least_force)


def open_worlds() -> int:
    """How many worlds there are in this process, of all engines, that are not closed."""
    count = sum(isinstance(each, MujocoWorld) and not each._is_closed for each in gc.get_objects())
    if BULLET_IS_INSTALLED:
        connections = (pybullet.getConnectionInfo(client) for client in range(64))
        count += sum(connection["isConnected"] for connection in connections)
    return count
