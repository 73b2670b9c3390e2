"""Law and world on each engine, a batch, and plain loops in MuJoCo: processor time of a tick."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from rich.console import Console

import actuated_characters as ac
from actuated_characters.runs.plan import make_plan
from benchmarks.closed_loop import WALK
from benchmarks.support.mujoco_loops import MujocoLoop, ServoLoop, StepAlone
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from controller_node.parameters import make_controller
from msgs_config.character.model import Character
from sim_node.physics.engine import INSTALLED_ENGINES

_BLOCK, _BLOCKS, _WARM_UP = 32, 60, 3  # ticks; blocks of each, in turn
_WORLDS = 16
_TICKS = _BLOCK * _BLOCKS + 1
_PEER, _SERVOS = "MuJoCo, stable PD in numpy", "MuJoCo, servos in C"
_ALONE = "MuJoCo, its step alone in the same states"
_BATCH = f"a batch of {_WORLDS}, one thread, a humanoid"


def measure_engines(console: Console) -> list[Ratio]:
    """Measure and print the table; the ratio of each loop to MuJoCo's with numpy."""
    console.print("engines: humanoid, walk ...")
    character = ac.load_character("humanoid")
    loops = {**_ours(character), _BATCH: _batch_loop(character), **_peers(character)}
    costs = _costs_us(loops)
    table = make_table("a tick (µs of processor time)", ("", "5th percentile", "median"))
    for label, (low, median) in costs.items():
        table.add_row(label, f"{low:.1f}", f"{median:.1f}")
    console.print(table)
    peer, servos = costs[_PEER][0], costs[_SERVOS][0]
    return [
        *(
            Ratio(f"tick on {engine}", costs[engine][0] / peer, f"tick / {_PEER}")
            for engine in INSTALLED_ENGINES
        ),
        Ratio("tick of a batch", costs[_BATCH][0] / servos, f"a humanoid's tick / {_SERVOS}"),
        Ratio(
            "tick of a batch, law",
            costs[_BATCH][1] / costs[_ALONE][1],
            f"a humanoid's tick / {_ALONE}, medians",
        ),
    ]


def _ours(character: Character) -> dict[str, Callable[[int], object]]:
    loops: dict[str, Callable[[int], object]] = {}
    for engine in INSTALLED_ENGINES:
        controller = ac.Controller(character, clip="walk")
        simulation = ac.Simulation(character, start=controller.start, engine=engine)
        loops[engine] = partial(_tick, controller, simulation)
    return loops


def _tick(controller: ac.Controller, simulation: ac.Simulation, ticks: int) -> None:
    for _ in range(ticks):
        simulation.step(controller.compute_effort(simulation.state))


def _batch_loop(character: Character) -> Callable[[int], object]:
    """So many ticks of a humanoid, in calls of eight, as a policy would make them."""
    batch = ac.Batch(character, _WORLDS, threads=1, clip="walk")
    eight = partial(batch.step, ticks=8)
    return lambda ticks: _repeat(eight, ticks // 8)


def _repeat(step: Callable[[], object], ticks: int) -> None:
    for _ in range(ticks):
        step()


def _peers(character: Character) -> dict[str, Callable[[int], object]]:
    plan = make_plan("humanoid", 1.0, WALK, {}, {})
    states = [plan.reference.sample(tick / 240.0) for tick in range(_TICKS + 1)]
    gains = make_controller(character, plan.reference, plan.controller).settings.gains
    arguments = (character, states, gains.stiffness, gains.damping)
    controller = ac.Controller(character, clip="walk")
    simulation = ac.Simulation(character, controller.start, engine="mujoco")
    peers = {
        _PEER: MujocoLoop(*arguments).step,
        _SERVOS: ServoLoop(*arguments).step,
        _ALONE: StepAlone(controller, simulation, _TICKS).step,
    }
    return {label: partial(_repeat, step) for label, step in peers.items()}


def _costs_us(loops: dict[str, Callable[[int], object]]) -> dict[str, tuple[float, float]]:
    """The 5th percentile and the median of blocks, which take turns: all see the same machine."""
    blocks: dict[str, list[float]] = {label: [] for label in loops}
    for _ in range(_BLOCKS):
        for label, advance in loops.items():
            begun = time.process_time()
            advance(_BLOCK)
            humanoids = _WORLDS if label == _BATCH else 1
            spent = (time.process_time() - begun) / (_BLOCK * humanoids)
            blocks[label].append(1e6 * spent)
    return {
        label: (float(np.percentile(each[_WARM_UP:], 5)), float(np.median(each[_WARM_UP:])))
        for label, each in blocks.items()
    }
