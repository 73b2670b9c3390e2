"""A world in which a motion is tried: the simulation and the planning controller of a run."""

from dataclasses import dataclass

import numpy as np

from actuated_characters.metrics.error_measures import is_lost
from actuated_characters.reconstruction.problem import Problem
from actuated_characters.runs.planned.wrenches import push_schedule
from controller_node.parameters import make_controller
from controller_node.planner.planner import PlannerSnapshot, PredictivePlanner
from controller_node.references.base import ReferenceState
from controller_node.references.offsets import Offsets
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.errors import SimulationError
from sim_node.physics.simulation import Simulation, Snapshot
from sim_node.simulation_factory import make_character_setup, make_simulation_settings


@dataclass(frozen=True)
class Place:
    """A state of a world, from which any other world can go on."""

    tick: int  # ticks since the first state
    snapshot: Snapshot
    planner: PlannerSnapshot


@dataclass(frozen=True)
class Branch:
    """What a world is to do: go on from a place, window after window."""

    place: Place | None  # None: in the first state
    seeds: tuple[int, ...]  # seeds of the samples of each window's plans


@dataclass(frozen=True)
class Grown:
    """What has become of a branch, in its last window."""

    place: Place
    plans: tuple[tuple[int, Offsets], ...]  # plans made in it, each with the tick when it begins
    motion: FloatArray  # (k + 1, n) positions in the window, from the state that it began in on
    end: FloatArray  # (2 n,) position and velocity
    cost: float  # mean cost of the window's states
    ahead: float  # cost of going on as planned


@dataclass(frozen=True)
class Lost:
    """What is left of a branch that in a window diverged, or went too far from the motion."""

    motion: FloatArray  # (k + 1, n) positions in the window until then


class TrialWorld:
    """One process's engine for a problem."""

    def __init__(self, problem: Problem, window_ticks: int) -> None:
        """Build world, controller and planner.

        Raises:
            ActuatedCharactersError: a name or value is wrong.
        """
        self.plan, self._window_ticks = problem.plan(), window_ticks
        self._pushes = problem.planned_pushes(self.plan)
        self._controller = make_controller(
            self.plan.character, self.plan.reference, self.plan.controller
        )
        planner = self._controller.planner
        assert isinstance(planner, PredictivePlanner)
        self._planner = planner
        self._period = planner.settings.period
        self._centre_at = DynamicsModel(self.plan.character).centre_of_mass_at
        self._simulation = self._fresh()
        self._episode_ns = self._simulation.characters[0].state.stamp_ns

    def close(self) -> None:
        """End the engine."""
        self._simulation.close()

    def grow(self, branch: Branch) -> Grown | Lost:
        """Simulate a branch's windows, as far as it is not lost."""
        place = branch.place
        if place is None:
            self._simulation.close()  # only a new world returns to a state without a step
            self._simulation = self._fresh()
        else:
            self._simulation.load_snapshot(place.snapshot)
        self._controller.begin_episode(self._episode_ns)  # it forgets what it planned before
        tick = 0 if place is None else place.tick
        planner = self._planner.snapshot() if place is None else place.planner
        for seed in branch.seeds:
            self._planner.restore(planner, seed)
            grown = self._window(tick, min(tick + self._window_ticks, self.plan.ticks))
            if isinstance(grown, Lost):
                break
            tick, planner = grown.place.tick, grown.place.planner
        return grown

    def _window(self, first: int, last: int) -> Grown | Lost:
        """Simulate the ticks of a window."""
        plans: list[tuple[int, Offsets]] = []
        costs: list[float] = []
        before, gains = self._planner.plan, self._controller.settings.gains
        (simulated,) = self._simulation.characters
        motion = [simulated.state.position]
        pushes = push_schedule(self.plan, self._pushes)
        for tick in range(first, last):
            effort, _ = self._controller.compute_effort(simulated.state, self._episode_ns)
            made = self._planner.plan
            if made is not None and made is not before:  # a plan in force stays one object
                plans.append((made.tick, made.offsets.during(made.tick, self._period)))
                before = made
            try:
                self._simulation.step(
                    [np.where(simulated.commanded, effort, 0.0)],
                    [pushes.take(self._simulation.tick)],
                )
            except SimulationError:
                return Lost(np.array(motion))
            motion.append(simulated.state.position)
            if (tick + 1) % self._period == 0 or tick + 1 == last:
                costs.append(self._planner.cost(tick + 1, simulated.state, gains, self._desired))
        if self._is_lost(last):
            return Lost(np.array(motion))
        state = simulated.state
        return Grown(
            Place(last, self._simulation.snapshot(), self._planner.snapshot()),
            tuple(plans),
            np.array(motion),
            np.concatenate((state.position, state.velocity)),
            float(np.mean(costs)),
            self._planner.cost_ahead(last, state, gains, self._desired),
        )

    def _desired(self, tick: int) -> ReferenceState:
        return self.plan.reference.sample(self._controller.clock.time_after(tick))

    def _is_lost(self, tick: int) -> bool:
        here = self._centre_at(self._simulation.characters[0].state.position)
        return is_lost(here, self._centre_at(self._desired(tick).configuration.position))

    def _fresh(self) -> Simulation:
        setup = make_character_setup(self.plan.character, self.plan.simulator)
        return Simulation([setup], make_simulation_settings(self.plan.simulator))
