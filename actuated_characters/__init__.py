"""Simulated characters, actuated by torques: what `import actuated_characters` gives.

Each name is imported when it is first used, so that the import itself loads neither ROS nor an
engine.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from actuated_characters.api import Controller as Controller
    from actuated_characters.api import Simulation as Simulation
    from actuated_characters.api import run as run
    from actuated_characters.batch.worlds import Batch as Batch
    from msgs_config.character.loading import load_character as load_character
    from msgs_config.character.model import Character as Character
    from msgs_config.errors import ActuatedCharactersError as ActuatedCharactersError
    from msgs_config.messages.state import StampedState as StampedState

_HOMES = {
    "ActuatedCharactersError": "msgs_config.errors",
    "Batch": "actuated_characters.batch.worlds",
    "Character": "msgs_config.character.model",
    "Controller": "actuated_characters.api",
    "Simulation": "actuated_characters.api",
    "StampedState": "msgs_config.messages.state",
    "load_character": "msgs_config.character.loading",
    "run": "actuated_characters.api",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
