"""The loop of simulation and controller joined in one process, without ROS."""

from collections.abc import Iterator

import numpy as np

from controller_node.parameters import make_controller
from experiment.metrics import Tick
from experiment.plan import Plan
from sim_node.parameters import make_role, make_settings
from sim_node.simulation import Simulation


def ticks_in_process(plan: Plan) -> Iterator[Tick]:
    """The ticks of a plan, one by one.

    The states are those of a run over topics, bit for bit.

    Raises:
        SimulationError: the simulation diverged.
    """
    controller = make_controller(plan.character, plan.reference, plan.controller)
    role = make_role(plan.character, plan.simulator)
    with Simulation([role], make_settings(plan.simulator)) as simulation:
        (actor,) = simulation.actors
        episode_ns = actor.state.stamp_ns
        for _ in range(plan.ticks):
            state = actor.state
            effort, reference = controller.answer(state, episode_ns)
            simulation.step([np.where(actor.commanded, effort, 0.0)])
            following = actor.state
            assert following.effort is not None
            yield Tick(state, following, reference)
