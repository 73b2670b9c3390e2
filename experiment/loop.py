"""The loop of simulation and controller joined in one process, without ROS."""

from collections.abc import Iterator, Sequence

import numpy as np

from controller_node.parameters import make_controller
from experiment.metrics import Tick
from experiment.plan import Plan
from experiment.planned_push import PlannedPush
from msgs_config.tick_clock import TickClock
from sim_node.parameters import make_role, make_settings, push_ticks
from sim_node.pushes import PushSchedule
from sim_node.simulation import Simulation


def ticks_in_process(plan: Plan, pushes: Sequence[PlannedPush] = ()) -> Iterator[Tick]:
    """The ticks of a plan, one by one, with pushes.

    The states are those of a run over topics, bit for bit.

    Raises:
        SimulationError: the simulation diverged.
    """
    controller = make_controller(plan.character, plan.reference, plan.controller)
    role = make_role(plan.character, plan.simulator)
    schedule, clock = PushSchedule(plan.character), TickClock(plan.simulator.integer("rate"))
    for push in pushes:
        content = push.arrays()
        schedule.add(
            content.links,
            content.wrenches,
            content.points,
            first_tick=clock.first_tick_from(push.stamp_ns),
            ticks=push_ticks(plan.simulator),
        )
    with Simulation([role], make_settings(plan.simulator)) as simulation:
        (actor,) = simulation.actors
        episode_ns = actor.state.stamp_ns
        for _ in range(plan.ticks):
            state = actor.state
            effort, reference = controller.answer(state, episode_ns)
            acting = schedule.take(simulation.tick)
            simulation.step([np.where(actor.commanded, effort, 0.0)], [acting])
            following = actor.state
            assert following.effort is not None
            yield Tick(state, following, reference)
