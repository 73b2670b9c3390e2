"""The engines that are installed, and PyBullet itself for the tests that ask it.

Where it is not installed, those are skipped; all others run, too, with the engine that is there.
"""

import gc
from typing import Any, NoReturn

import pytest

from sim_node.physics.engine import ENGINES, INSTALLED_ENGINES
from sim_node.physics.mujoco.world import MujocoWorld

BULLET_IS_INSTALLED = "bullet" in INSTALLED_ENGINES
NOT_INSTALLED = "it asks PyBullet itself, which is not installed"
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


pybullet: Any = _Missing()
Engine: Any = _Missing()
load_urdf: Any = _Missing()
if BULLET_IS_INSTALLED:
    from sim_node.physics.bullet.client import pybullet


def need_engine(name: str) -> None:
    """Skip the test, or the whole file, that calls it where an engine is not installed."""
    if name not in INSTALLED_ENGINES:
        pytest.skip(f"{ENGINES[name].package} is not installed", allow_module_level=True)


def open_worlds() -> int:
    """How many worlds there are in this process, of all engines, that are not closed."""
    count = sum(isinstance(each, MujocoWorld) and not each._is_closed for each in gc.get_objects())
    if BULLET_IS_INSTALLED:
        connections = (pybullet.getConnectionInfo(client) for client in range(64))
        count += sum(connection["isConnected"] for connection in connections)
    return count
