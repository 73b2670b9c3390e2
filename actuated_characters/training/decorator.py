"""How the functions of episodes are compiled."""

from pathlib import Path

from controller_node.planner.compiled import decorator
from msgs_config.compiled.decorator import Compiler

_FILES = ("episodes", "episode_types", "rewards")

compiled = Compiler(
    *decorator.compiled.sources, *(Path(__file__).with_name(f"{name}.py") for name in _FILES)
)
