"""What is seen of a run: the loop of simulator and controller alone, in this process."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.metrics.error_measures import centre_path, is_lost
from actuated_characters.metrics.falls import FallWatch, PostureReader
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.throws import plan_throws
from actuated_characters.runs.planned.wrenches import parse_pushes_within
from benchmarks.tables.case import Case
from controller_node.behaviours.base import Mode
from controller_node.parameters import make_controller
from controller_node.planner.anchor import Anchor
from controller_node.references.steering.course import Course
from controller_node.references.steering.reference import SteeredReference
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.errors import SimulationError
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_simulation_settings

FEET = ("right_ankle", "left_ankle")


@dataclass(frozen=True, eq=False)
class Seen:
    """What is seen of a run, in its t ticks before a fall, or to the end."""

    case: Case
    plan: RunPlan
    position: FloatArray  # (t, n) before each tick
    velocity: FloatArray  # (t, n)
    desired: FloatArray  # (t, n) position of the reference, at its own place
    loads: FloatArray  # (t, 2) N on right and left foot; 0 where the controller needs no contacts
    anchors: Sequence[Anchor]  # (t,) by which a planner's reference has given way
    fell_at: float | None  # s, the first time
    lost_at: float | None  # s
    is_up: bool  # whether it ends upright, tracking its reference or in a machine's state

    @property
    def rate(self) -> int:
        """Ticks a second."""
        return self.plan.simulation.rate_hz

    @property
    def lasted(self) -> float:
        """How long, s."""
        return len(self.position) / self.rate

    @property
    def measured(self) -> slice:
        """The ticks that are measured; all, where it ended before."""
        first = round(self.case.since * self.rate)
        return slice(first if first < len(self.position) else 0, None)

    @property
    def courses(self) -> list[Course]:
        """What was commanded in each tick (t,)."""
        reference = self.plan.reference
        assert isinstance(reference, SteeredReference)
        return [reference.course(tick) for tick in range(len(self.position))]

    @property
    def airborne(self) -> BoolArray:
        """Whether (t,) no foot touches the ground; the first tick, in which it is put down, not."""
        airborne = np.array((self.loads == 0.0).all(axis=1), dtype=np.bool_)
        airborne[:1] = False
        return airborne

    def centres(self, positions: FloatArray) -> FloatArray:
        """Centres of mass (r, 3) in m at positions (r, n)."""
        return centre_path(self.plan.character, positions)


def see(case: Case) -> Seen:
    """Run a case to its end.

    Raises:
        ActuatedCharactersError: a name or a value of it is wrong.
    """
    plan, own = case.plan(), case.plan(case.character)
    controller = make_controller(own.character, own.reference, own.controller)
    links = [link.name for link in plan.character.links]
    feet = [links.index(foot) for foot in FEET if foot in links]
    rate, loads = plan.simulation.rate_hz, list[FloatArray]()
    terrain = make_simulation_settings(plan.simulator).world.terrain
    fall = FallWatch(PostureReader(plan.character, terrain), rate)
    centre_at = DynamicsModel(plan.character).centre_of_mass_at
    rows: list[tuple[FloatArray, ...]] = []
    anchors: list[Anchor] = []
    fell_at = lost_at = None
    lies = False

    def note_loads(simulation: Simulation) -> None:
        touched = simulation.characters[0].contacts
        loads.append(np.zeros(2) if touched is None else touched.wrenches[feet, 2])

    pushes, (throws, _) = parse_pushes_within(case.pushes, plan), plan_throws(plan, case.throws)
    try:
        for tick in ticks_in_process(plan, pushes, throws, controller, note_loads):
            state, outlook = tick.state, controller.outlook
            assert tick.reference is not None
            wanted = tick.reference.position
            rows.append((state.position, state.velocity, wanted))
            anchors.append(outlook.anchor if outlook else Anchor())
            lies = fall.has_fallen(tick.following.position)
            if lies and fell_at is None:
                fell_at = len(rows) / rate
            if case.follows and is_lost(centre_at(state.position), centre_at(wanted)):
                lost_at = len(rows) / rate
            if lost_at is not None or (lies and case.until_fall and not case.follows):
                break
    except SimulationError:
        lies, lost_at = True, len(rows) / rate
        fell_at = lost_at if fell_at is None else fell_at
    mode = None if controller.mode is None else controller.mode.phase.mode
    position, velocity, desired = (np.array(column) for column in zip(*rows, strict=True))
    touching = np.array(loads[: len(rows)]).reshape(-1, 2)
    is_up = not lies and mode in (Mode.TRACK, Mode.STATE)
    return Seen(case, plan, position, velocity, desired, touching, anchors, fell_at, lost_at, is_up)
