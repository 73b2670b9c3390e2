"""What a tick of the simulator costs, and how that grows with the degrees of freedom (DoF)."""

import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from actuated_characters.runs.plan import make_plan
from benchmarks.closed_loop import WALK, in_process
from benchmarks.support.chains import write_chain
from benchmarks.support.nodes import Nodes
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from benchmarks.support.timing import timed, timed_engine
from msgs_config.arrays import FloatArray
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder
from sim_node.parameters import CharacterParameters, SimulatorParameters, load_parameters
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_simulation

_CHAINS = (1, 8, 32, 100)  # hinges
_HUMANOIDS = (1, 2, 4, 8)
_SPACING = 3.0  # m between humanoids
_WARM_UP, _TICKS = 100, 1500
_SMALL_TURN = 0.01  # rad by which each hinge is off the vertical


@dataclass(frozen=True)
class Cost:
    """What a tick costs."""

    label: str
    dofs: int
    engine_us: float  # median of the engine's own steps
    alone_us: float  # median
    over_topics_us: float  # median

    @property
    def per_dof_us(self) -> float:
        """A degree of freedom's share of a tick without topics."""
        return self.alone_us / self.dofs


def measure_cost(console: Console) -> list[Ratio]:
    """Measure and print a table for chains and one for humanoids; their ratios."""
    ratios = []
    with tempfile.TemporaryDirectory() as directory:
        chains = {_label(n, "hinge"): chain(Path(directory), n) for n in _CHAINS}
        crowds = {_label(n, "humanoid"): humanoids(n) for n in _HUMANOIDS}
        for kind in (chains, crowds):
            costs = []
            for label, given in kind.items():
                console.print(f"cost: {label} ...")
                costs.append(_measure(label, given))
            console.print(_table(costs))
            ratios += cost_ratios(costs)
    limp_us = costs[0].alone_us
    return [*ratios, Ratio("limp humanoid", limp_us / _walking_us(console), "tick / a walk's tick")]


def cost_ratios(costs: list[Cost]) -> list[Ratio]:
    """What the smallest and the largest cost beside the engine alone, and how that grows."""
    first, last = costs[0], costs[-1]
    growth = last.per_dof_us / first.per_dof_us
    return [
        *(Ratio(c.label, c.alone_us / c.engine_us, "tick / engine step alone") for c in costs),
        Ratio(f"{last.label}, growth", growth, f"tick per DoF / that of {first.label}"),
        Ratio(
            f"{last.label}, all", last.alone_us / first.alone_us, f"tick / that of {first.label}"
        ),
        Ratio(f"{first.label}, topics", first.over_topics_us / first.alone_us, "topics / alone"),
    ]


def _walking_us(console: Console) -> float:
    """Median duration in µs of the simulator's tick of a walk, without topics."""
    plan = make_plan("humanoid", (_WARM_UP + _TICKS) / 240.0, WALK, {}, {})
    with timed(Simulation, "step") as steps:
        in_process(plan)
    walking_us = 1e6 * float(np.median(steps[_WARM_UP:]))
    console.print(f"a walk's tick of the simulator: {walking_us:.0f} µs")
    return walking_us


def _label(count: int, kind: str) -> str:
    return f"{count} {kind}" + "s" * (count > 1)


def chain(directory: Path, hinges: int) -> dict[str, object]:
    """Parameters of a simulator of a chain that swings freely."""
    file = write_chain(directory, hinges)
    return {"character": str(file), "initial_position": [_SMALL_TURN] * hinges}


def humanoids(count: int) -> dict[str, object]:
    """Parameters of a simulator of limp humanoids in a row."""
    names = [f"humanoid_{index}" for index in range(count)]
    places = {f"{n}.placement": [0.0, _SPACING * i, 0.0, 0.0] for i, n in enumerate(names)}
    return {"character": "humanoid", "characters": names, **places}


def _measure(label: str, given: Mapping[str, object]) -> Cost:
    loaded = load_parameters(given)
    dofs = sum(each.character.layout.size for each in loaded.characters)
    with timed_engine() as engine:
        alone = np.median(1e6 * step_durations(loaded))
    engine_us = 1e6 * float(np.median(engine[-_TICKS:]))
    return Cost(label, dofs, engine_us, float(alone), _over_topics(loaded, given))


def step_durations(loaded: SimulatorParameters) -> FloatArray:
    """Durations (ticks,) in s of the steps of a simulation without ROS and without efforts."""
    with make_simulation(loaded) as simulation:
        efforts = [np.zeros(simulated.layout.size) for simulated in simulation.characters]
        times = []
        for _ in range(_WARM_UP + _TICKS + 1):
            times.append(time.perf_counter())
            simulation.step(efforts)
    return np.diff(times)[_WARM_UP:]


def _over_topics(loaded: SimulatorParameters, given: Mapping[str, object]) -> float:
    """Median duration in µs of the ticks of `sim_node`, whose states are answered by zeros."""
    ticks = _WARM_UP + _TICKS
    with Nodes() as nodes:
        nodes.start(topics.SIM_NODE, {**given, "max_ticks": ticks})
        nodes.wait_until(lambda: nodes.reports)
        spinner = PollingExecutor(nodes.node)
        limp = [_LimpController(nodes, each) for each in loaded.characters]

        def poll() -> None:
            answered = [controller.poll() for controller in limp]
            if any(answered):
                spinner.received()
            else:
                spinner.rest()

        nodes.wait_until(lambda: int(nodes.reports[-1]["tick"]) > ticks, poll)
        spinner.close()
        return float(nodes.reports[-1]["tick_us_p50"])


class _LimpController:
    """Answers the states of one character with zeros, at the least cost."""

    def __init__(self, nodes: Nodes, each: CharacterParameters) -> None:
        names = [n for n in each.character.layout.dof_names if not n.startswith("root_")]
        self._states = DirectSubscription(nodes.node, topics.JOINT_STATES.under(each.name))
        self._torques = create_publisher(nodes.node, topics.JOINT_TORQUES.under(each.name))
        self._encoder, self._zeros = JointStateEncoder(names), np.zeros(len(names))
        self._decoder = JointStateDecoder()

    def poll(self) -> bool:
        """Answer a state if there is one; whether there was."""
        raw = self._states.take()
        if raw is None:
            return False
        stamp_ns = self._decoder.decode(raw).stamp_ns
        self._torques.publish(self._encoder.encode(stamp_ns, effort=self._zeros))
        return True


def _table(costs: list[Cost]) -> Table:
    title = "one tick of the simulator (median), and a DoF's share over that of the smallest"
    alone = ("DoF", "engine µs", "alone µs", "ticks/s", "µs/DoF", "ratio")
    table = make_table(title, ("", *alone, "topics µs", "µs/DoF", "ratio"))
    first = costs[0]
    for cost in costs:
        row = [cost.label, str(cost.dofs), f"{cost.engine_us:.0f}", f"{cost.alone_us:.0f}"]
        row += [f"{1e6 / cost.alone_us:.0f}", *_per_dof(cost.per_dof_us, first.per_dof_us)]
        row += [f"{cost.over_topics_us:.0f}"]
        row += _per_dof(cost.over_topics_us / cost.dofs, first.over_topics_us / first.dofs)
        table.add_row(*row)
    return table


def _per_dof(value: float, smallest: float) -> list[str]:
    return [f"{value:.2f}", f"{value / smallest:.2f}"]
