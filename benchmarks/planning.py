"""Planning ahead: what it costs, what threads add to it, and how well it foresees the world."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from rich.console import Console

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from benchmarks.closed_loop import WALK
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from benchmarks.support.timing import yardstick_us
from controller_node.controller import Controller
from controller_node.parameters import make_controller_settings
from controller_node.planner import settings as planner_settings
from controller_node.planner.compiled.rollout import Desired
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.search.cost import ResidualModel
from controller_node.planner.search.rollout_pool import RolloutPool
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.messages.clock import TickClock
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

_RATE = 240  # Hz
_DURATION = 1.2  # s of the walk that is planned
_MOMENTS = (0.1, 0.3, 0.5, 0.7, 0.9, 1.1)  # s of the walk from which it looks ahead
_FORESEEN_SECONDS = (0.1, 0.3, 0.5)  # s
_CHECK = 24  # ticks, 0.1 s
_HORIZON = 120  # ticks
_SAMPLES = 40
_ROUNDS = 5


def measure_planning(console: Console) -> list[Ratio]:
    """Measure and print the tables; what a step and a simulated second cost."""
    console.print("planning ahead: humanoid, walk ...")
    plan = make_plan("humanoid", _DURATION, WALK, {}, {"planner": "predictive"})
    world = _World(plan)
    heading = ("threads", "thousand steps / s", "wall s / simulated s")
    table = make_table("planning ahead", heading)
    steps, ratios = {}, []
    for workers in (1, 2):
        steps[workers] = world.steps_a_second(workers)
        walked = _wall_time(workers)
        table.add_row(str(workers), f"{1e-3 * steps[workers]:.1f}", f"{walked:.2f}")
    console.print(table)
    ratios.append(Ratio("planning, a step", 1e6 / steps[1] / yardstick_us(), "step / yardstick"))
    how = "a step's time on two threads / half of that on one"
    ratios.append(Ratio("planning, 2 threads", 2.0 * steps[1] / steps[2], how))
    title = "centre of mass foreseen, off the world's (m)"
    foresight = make_table(title, ("after", "median", "largest"))
    errors = np.array([world.errors(moment) for moment in _MOMENTS])
    for ahead, column in zip(_FORESEEN_SECONDS, errors.T, strict=True):
        foresight.add_row(f"{ahead:g} s", f"{np.median(column):.4f}", f"{column.max():.4f}")
    console.print(foresight)
    return ratios


def _wall_time(workers: int) -> float:
    """Wall seconds a simulated second of the walk in this process."""
    settings: dict[str, object] = {"planner": "predictive", "plan.workers": workers}
    ticks = ticks_in_process(make_plan("humanoid", _DURATION, WALK, {}, settings))
    next(ticks)  # the first tick makes and compiles all, and its plan has many rounds
    started = time.perf_counter()
    count = sum(1 for _ in ticks)
    return (time.perf_counter() - started) * _RATE / count


class _World:
    """The walk from a moment on without a plan: in the planner's model, and in the simulator."""

    def __init__(self, plan: RunPlan) -> None:
        character = plan.character
        settings = planner_settings.make_planner_settings(character, plan.controller)
        assert settings is not None
        self._plan = plan
        self._control = make_controller_settings(character, plan.controller)
        self._model = ContactModel(
            character, period_s=1.0 / _RATE, gravity=9.81, friction=settings.parameters.friction
        )
        self._residual_model = ResidualModel(character, self._model, settings)
        self._body = self._model.body(self._control.gains)
        self._dynamics = DynamicsModel(character)
        self._knots = np.zeros((2, character.layout.size - 6))

    def steps_a_second(self, workers: int) -> float:
        """The rollouts' steps a wall second."""
        rollouts, start = RolloutPool(self._model, workers), self._desired(0.3)
        plans = np.repeat(self._knots[np.newaxis], _SAMPLES, axis=0)
        durations = []
        for _ in range(_ROUNDS):
            started = time.perf_counter()
            rollouts.simulate(start.positions[0], start.velocities[0], plans, start, self._body)
            durations.append(time.perf_counter() - started)
        return _SAMPLES * _HORIZON / min(durations)

    def errors(self, moment: float) -> FloatArray:
        """How far the centre of mass is off that foreseen, m, after each of `_FORESEEN_SECONDS`."""
        desired = self._desired(moment)
        features, sound = RolloutPool(self._model, 1).simulate(
            desired.positions[0], desired.velocities[0], self._knots[None], desired, self._body
        )
        assert sound.all()
        foreseen, _ = self._residual_model.balance(features[0])
        centres = list(self._centres(moment))
        after = [round(ahead * _RATE) for ahead in _FORESEEN_SECONDS]
        return np.array(
            [np.linalg.norm(foreseen[tick // _CHECK - 1] - centres[tick - 1]) for tick in after]
        )

    def _desired(self, moment: float) -> Desired:
        times = [moment + tick / _RATE for tick in range(_HORIZON + 1)]
        states = [self._plan.reference.sample(each) for each in times]
        positions = [self._model.position_of(each.configuration.position) for each in states]
        velocities = [each.velocity for each in states]
        return Desired(0, 1, _HORIZON, 0, _CHECK, np.array(positions), np.array(velocities))

    def _centres(self, moment: float) -> Iterator[FloatArray]:
        """Where the centre of mass is in the simulator, tick after tick."""
        clock, first = TickClock(_RATE), round(moment * _RATE)
        start = self._plan.reference.sample(moment)
        values = self._plan.simulator | {
            "initial_position": start.configuration.position.tolist(),
            "initial_velocity": start.velocity.tolist(),
        }
        values = type(self._plan.simulator)(values)
        controller = Controller(
            self._plan.character, self._plan.reference, self._control, rate_hz=_RATE, gravity=9.81
        )
        setup = make_character_setup(self._plan.character, values)
        with Simulation([setup], make_simulation_settings(values)) as simulation:
            (simulated,) = simulation.characters
            for tick in range(_HORIZON):
                state = replace(simulated.state, stamp_ns=clock.stamp_ns(1 + first + tick))
                effort, _ = controller.compute_effort(state, clock.stamp_ns(1))
                simulation.step([np.where(simulated.commanded, effort, 0.0)], [()])
                self._dynamics.update(simulated.state.position, simulated.state.velocity)
                yield self._dynamics.centre_of_mass()
