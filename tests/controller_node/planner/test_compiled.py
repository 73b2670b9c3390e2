"""Every file with compiled functions counts where they are looked for."""

import importlib
from pathlib import Path

import pytest
from numba.core.registry import CPUDispatcher as Dispatcher

from actuated_characters.training import decorator as of_training
from controller_node.planner.compiled import decorator, rollout
from msgs_config.compiled import decorator as basics
from msgs_config.compiled.decorator import Compiler
from sim_node.physics.mujoco import compiled_step


def test_the_rollouts_are_kept_where_the_planners_sources_count() -> None:
    assert Path(rollout.roll_out.stats.cache_path).is_relative_to(decorator.compiled.cache)
    assert decorator.compiled.cache != basics.compiled.cache


@pytest.mark.parametrize(
    ("package", "compiled"),
    [
        ("msgs_config.compiled", basics.compiled),
        ("controller_node.planner.compiled", decorator.compiled),
        ("sim_node.physics.mujoco", compiled_step.compiled),
        ("actuated_characters.training", of_training.compiled),
    ],
)
def test_every_compiled_function_is_of_a_source_that_counts(
    package: str, compiled: Compiler
) -> None:
    folder = Path(str(importlib.import_module(package).__file__)).parent
    names = [each.stem for each in folder.glob("*.py") if each.stem != "__init__"]
    modules = [importlib.import_module(f"{package}.{name}") for name in names]
    functions = [
        each for module in modules for each in vars(module).values() if isinstance(each, Dispatcher)
    ]
    files = {Path(each.py_func.__code__.co_filename) for each in functions}

    assert len(functions) > 20
    assert files <= set(compiled.sources)
