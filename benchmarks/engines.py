"""README's loop on each engine, beside plain loops in MuJoCo: processor time of a tick."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from rich.console import Console

import actuated_characters as ac
from actuated_characters.runs.plan import make_plan
from benchmarks.closed_loop import WALK
from benchmarks.support.mujoco_loops import MujocoLoop, ServoLoop
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from controller_node.parameters import make_controller
from msgs_config.character.model import Character
from sim_node.physics.engine import INSTALLED_ENGINES

_BLOCK, _BLOCKS, _WARM_UP = 32, 60, 3  # ticks; blocks of each, in turn
_TICKS = _BLOCK * _BLOCKS + 1
_PEER, _SERVOS = "MuJoCo, stable PD in numpy", "MuJoCo, servos in C"


def measure_engines(console: Console) -> list[Ratio]:
    """Measure and print the table; the ratio of each loop to MuJoCo's with numpy."""
    console.print("engines: humanoid, walk ...")
    character = ac.load_character("humanoid")
    costs = _costs_us({**_ours(character), **_peers(character)})
    table = make_table("a tick (µs of processor time)", ("", "5th percentile", "median"))
    for label, (low, median) in costs.items():
        table.add_row(label, f"{low:.1f}", f"{median:.1f}")
    console.print(table)
    peer = costs[_PEER][0]
    return [
        Ratio(f"tick on {label}", low / peer, f"tick / {_PEER}")
        for label, (low, _) in costs.items()
        if label not in (_PEER, _SERVOS)
    ]


def _ours(character: Character) -> dict[str, Callable[[], object]]:
    loops: dict[str, Callable[[], object]] = {}
    for engine in INSTALLED_ENGINES:
        controller = ac.Controller(character, clip="walk")
        simulation = ac.Simulation(character, start=controller.start, engine=engine)
        loops[engine] = partial(_tick, controller, simulation)
    return loops


def _tick(controller: ac.Controller, simulation: ac.Simulation) -> None:
    simulation.step(controller.compute_effort(simulation.state))


def _peers(character: Character) -> dict[str, Callable[[], object]]:
    plan = make_plan("humanoid", 1.0, WALK, {}, {})
    states = [plan.reference.sample(tick / 240.0) for tick in range(_TICKS + 1)]
    gains = make_controller(character, plan.reference, plan.controller).settings.gains
    arguments = (character, states, gains.stiffness, gains.damping)
    return {_PEER: MujocoLoop(*arguments).step, _SERVOS: ServoLoop(*arguments).step}


def _costs_us(loops: dict[str, Callable[[], object]]) -> dict[str, tuple[float, float]]:
    """The 5th percentile and the median of blocks, which take turns: all see the same machine."""
    blocks: dict[str, list[float]] = {label: [] for label in loops}
    for _ in range(_BLOCKS):
        for label, tick in loops.items():
            begun = time.process_time()
            for _ in range(_BLOCK):
                tick()
            blocks[label].append((time.process_time() - begun) / _BLOCK * 1e6)
    return {
        label: (float(np.percentile(each[_WARM_UP:], 5)), float(np.median(each[_WARM_UP:])))
        for label, each in blocks.items()
    }
