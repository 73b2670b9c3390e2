"""The loop of simulation and controller alone, without nodes and messages: the same states."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from actuated_characters.metrics.run_metrics import Tick
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.behaviours import PlannedBehaviour
from actuated_characters.runs.planned.pins import PlannedPin, pin_schedule
from actuated_characters.runs.planned.strengths import PlannedStrengths
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.wrenches import PlannedPush, push_schedule
from controller_node.behaviours.asked import asked_behaviour
from controller_node.controller import Controller
from controller_node.parameters import make_controller
from controller_node.strength import strengths_of
from msgs_config.messages.clock import TickClock
from sim_node.physics.balls.throws import ThrowQueue
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

Watch = Callable[[Simulation], object]
"""Is called with the simulation after each tick."""


def ticks_in_process(
    plan: RunPlan,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
    controller: Controller | None = None,
    watch: Watch | None = None,
    strengths: Sequence[PlannedStrengths] = (),
    pins: Sequence[PlannedPin] = (),
    behaviours: Sequence[PlannedBehaviour] = (),
) -> Iterator[Tick]:
    """The ticks of a plan, one by one, with all that is sent beside.

    The states are those of a run over topics, bit for bit. To look at the controller as well, give
    a fresh one of the plan; to look at the simulation, a `watch`.

    Raises:
        SimulationError: the simulation diverged.
    """
    controller = controller or make_controller(plan.character, plan.reference, plan.controller)
    setup = make_character_setup(plan.character, plan.simulator)
    wrenches, clock = push_schedule(plan, pushes), TickClock(plan.simulation.rate_hz)
    balls, held = ThrowQueue(), pin_schedule(plan, pins)
    for throw in throws:
        balls.add(throw.throw, clock.first_tick_from(throw.stamp_ns))
    with Simulation([setup], make_simulation_settings(plan.simulator)) as simulation:
        simulation.watches_contacts = controller.needs_contacts
        (character,) = simulation.characters
        episode_ns = character.state.stamp_ns
        for each in strengths:
            names, values = tuple(each.strengths), tuple(each.strengths.values())
            taken = strengths_of(controller.layout, names, values, each.stamp_ns)
            controller.set_strengths(taken, episode_ns=episode_ns)
        for asked in behaviours:
            controller.ask(asked_behaviour((asked.ask,), asked.stamp_ns), episode_ns=episode_ns)
        drives_all = character.commanded.all()
        for _ in range(plan.ticks):
            state = character.state
            touched = None if character.contacts is None else character.contacts.wrenches
            effort, reference = controller.compute_effort(state, episode_ns, touched)
            commanded = effort if drives_all else np.where(character.commanded, effort, 0.0)
            acting, thrown = wrenches.take(simulation.tick), balls.take(simulation.tick)
            simulation.step([commanded], [acting], thrown, [held.take(simulation.tick)])
            following = character.state
            assert following.effort is not None
            if watch is not None:
                watch(simulation)
            yield Tick(state, following, reference)
