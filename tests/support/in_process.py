"""A runner whose runs are made in this process, without ROS; bit-identical to the nodes'."""

from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import ModeChange, Recording
from actuated_characters.metrics.falls import reader_for
from actuated_characters.metrics.run_metrics import Measurement, Tick
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned_throws import plan_throws
from actuated_characters.studies.catalogue import load_study
from actuated_characters.studies.framework.result import StudyResult
from actuated_characters.studies.framework.study import RunResult, RunSpec
from controller_node.behaviours.base import ModeReport
from controller_node.parameters import make_controller
from msgs_config.errors import SimulationError
from msgs_config.messages import configuration
from msgs_config.messages.projectiles import BallStates, ball_names
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WrenchArrays
from sim_node.node_settings import make_node_settings
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.physics.simulation import Simulation
from sim_node.physics.throws import ThrowQueue
from sim_node.physics.wrenches import WrenchQueue
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.physics import read_wrenches


class InProcessRunner:
    """Runs a study's cases one by one; files that they need go to a directory."""

    fine = False

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self.cases: list[RunSpec] = []  # that were run

    def run(self, case: RunSpec) -> RunResult:
        """Run a case to its end, or until it diverges."""
        self.cases.append(case)
        plan, _ = case.plan()
        run = _Run(plan, case)
        diverged = ""
        try:
            run.go_on()
        except SimulationError as error:
            diverged = str(error)
        return RunResult(run.recording(), run.summary(), diverged)

    def study(self, name: str) -> StudyResult:
        """Run all of a study."""
        return load_study(name).run(self)

    def path(self, name: str) -> Path:
        """Where a file that runs need is to be written."""
        return self._directory / name


class _Run:
    """One run, and what a bag would hold of it."""

    def __init__(self, plan: RunPlan, case: RunSpec) -> None:
        self._plan, self._case = plan, case
        self._states: list[StampedState] = []
        self._references: list[StampedReference] = []
        self._contacts: list[WrenchArrays] = []
        self._pushes: list[WrenchArrays] = []
        self._modes: list[ModeReport] = []
        self._throws: list[tuple[ProjectileThrow, ...]] = []
        self._balls: list[BallStates | None] = [None]

    def go_on(self) -> None:
        """Run to the end. Raises SimulationError if it diverges."""
        plan = self._plan
        controller = make_controller(plan.character, plan.reference, plan.controller)
        setup = make_character_setup(plan.character, plan.simulator)
        with Simulation([setup], make_simulation_settings(plan.simulator)) as simulation:
            simulation.watches_contacts = self._case.contacts or controller.needs_contacts
            balls = self._throw_schedule(simulation)
            schedule, (simulated,) = self._schedule(simulation), simulation.characters
            episode_ns = simulated.state.stamp_ns
            self._states.append(simulated.state)
            for _ in range(plan.ticks):
                touched = None if simulated.contacts is None else simulated.contacts.wrenches
                effort, reference = controller.compute_effort(simulated.state, episode_ns, touched)
                self._references.append(reference)
                if controller.mode is not None and controller.mode not in self._modes[-1:]:
                    self._modes.append(controller.mode)
                pushes, throws = schedule.take(simulation.tick), balls.take(simulation.tick)
                simulation.step([np.where(simulated.commanded, effort, 0.0)], [pushes], throws)
                self._add(simulated)
                self._add_balls(simulation)

    def _throw_schedule(self, simulation: Simulation) -> ThrowQueue:
        schedule = ThrowQueue()
        for each in plan_throws(self._plan, self._case.throws)[0]:
            schedule.add(each.throw, simulation.clock.first_tick_from(each.stamp_ns))
        return schedule

    def _add_balls(self, simulation: Simulation) -> None:
        self._throws.append(simulation.throws)
        names = ball_names(len(simulation.balls))
        there = BallStates(simulation.stamp_ns, names, simulation.ball_motion())
        self._balls.append(there if names else None)

    def _schedule(self, simulation: Simulation) -> WrenchQueue:
        """The pushes as the simulator's node takes them: from the first tick not before a stamp."""
        schedule = WrenchQueue(self._plan.character)
        for push in self._case.pushes:
            arrays = push.arrays()
            schedule.add(
                arrays.links,
                arrays.wrenches,
                arrays.points,
                first_tick=simulation.clock.first_tick_from(push.stamp_ns),
                ticks=make_node_settings(self._plan.simulator).push_ticks,
            )
        return schedule

    def _add(self, simulated: SimulatedCharacter) -> None:
        self._states.append(simulated.state)
        pushes, contacts = read_wrenches(simulated)
        self._pushes.append(pushes)
        if contacts is not None:
            self._contacts.append(contacts)

    def recording(self) -> Recording:
        """What a bag would hold of it; a state without an answer has no reference."""
        states, size = self._states, self._plan.character.layout.size
        missing = np.full(size, np.nan)
        references = self._references[: len(states)]
        nothing = [missing] * (len(states) - len(references))
        return Recording(
            character=self._plan.character,
            parameters=self._plan.simulator,
            stamps_ns=np.array([state.stamp_ns for state in states], dtype=np.intp),
            published_ns=np.arange(len(states), dtype=np.intp),
            position=np.stack([state.position for state in states]),
            velocity=np.stack([state.velocity for state in states]),
            effort=np.array([state.effort for state in states[1:]]).reshape(-1, size),
            reference_position=np.stack([*(r.position for r in references), *nothing]),
            reference_velocity=np.stack([*(r.velocity for r in references), *nothing]),
            contacts=tuple(self._contacts),
            applied_wrench=tuple(self._pushes),
            commands=((),) * len(states),
            modes=tuple(
                ModeChange(each.stamp_ns, each.phase.mode.value, dict(each.phase.facts))
                for each in self._modes
            ),
            throws=tuple(self._throws),
            balls=tuple(self._balls),
        )

    def summary(self) -> dict[str, object]:
        """The figures of summary.json, as far as they are measured."""
        plan = self._plan
        known = configuration.parse(configuration.describe(plan.character, plan.simulator))
        measurement = Measurement(known, reader_for(plan.character))
        for each in self._modes:
            measurement.add_mode(each.stamp_ns, each.phase.mode.value)
        for state in self._states:
            measurement.add_state(state)
        for row, state in enumerate(self._states[1:]):
            measurement.add_tick(Tick(self._states[row], state, self._references[row]))
        return {"character": plan.character.name, **measurement.summary(wall_time=1.0)}
