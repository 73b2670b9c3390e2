"""The loop of simulation and controller joined in one process, without ROS."""

from collections.abc import Iterator, Sequence

import numpy as np

from actuated_characters.metrics.run_metrics import Tick
from actuated_characters.runs.plan import Plan
from actuated_characters.runs.planned_throws import PlannedThrow
from actuated_characters.runs.planned_wrenches import PlannedPush, push_schedule
from controller_node.controller import Controller
from controller_node.parameters import make_controller
from msgs_config.messages.clock import TickClock
from sim_node.parameters import make_character_setup, make_settings
from sim_node.physics.simulation import Simulation
from sim_node.physics.throws import ThrowQueue


def ticks_in_process(
    plan: Plan,
    pushes: Sequence[PlannedPush] = (),
    throws: Sequence[PlannedThrow] = (),
    controller: Controller | None = None,
) -> Iterator[Tick]:
    """The ticks of a plan, one by one, with pushes and throws.

    The states are those of a run over topics, bit for bit. Who wants to look at the controller
    besides gives a fresh one of the plan.

    Raises:
        SimulationError: the simulation diverged.
    """
    controller = controller or make_controller(plan.character, plan.reference, plan.controller)
    role = make_character_setup(plan.character, plan.simulator)
    schedule, clock = push_schedule(plan, pushes), TickClock(plan.simulator.integer("rate"))
    balls = ThrowQueue()
    for throw in throws:
        balls.add(throw.throw, clock.first_tick_from(throw.stamp_ns))
    with Simulation([role], make_settings(plan.simulator)) as simulation:
        simulation.watches_contacts = controller.needs_contacts
        (actor,) = simulation.characters
        episode_ns = actor.state.stamp_ns
        for _ in range(plan.ticks):
            state = actor.state
            touched = None if actor.contacts is None else actor.contacts.wrenches
            effort, reference = controller.compute_effort(state, episode_ns, touched)
            acting = schedule.take(simulation.tick)
            thrown = balls.take(simulation.tick)
            simulation.step([np.where(actor.commanded, effort, 0.0)], [acting], thrown)
            following = actor.state
            assert following.effort is not None
            yield Tick(state, following, reference)
