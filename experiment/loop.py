"""The loop of simulation and controller joined in one process, without ROS."""

from collections.abc import Iterator

import numpy as np

from controller_node.parameters import make_controller
from experiment.metrics import Tick
from experiment.plan import Plan
from sim_node.parameters import make_settings
from sim_node.simulation import Simulation


def ticks_in_process(plan: Plan) -> Iterator[Tick]:
    """The ticks of a plan, one by one.

    The states are those of a run over topics, bit for bit.

    Raises:
        SimulationError: the simulation diverged.
    """
    controller = make_controller(plan.character, plan.reference, plan.controller)
    with Simulation(plan.character, make_settings(plan.simulator)) as simulation:
        episode_ns = simulation.state.stamp_ns
        for _ in range(plan.ticks):
            state = simulation.state
            effort, reference = controller.answer(state, episode_ns)
            following = simulation.step(np.where(simulation.commanded, effort, 0.0))
            assert following.effort is not None
            yield Tick(state, following, reference)
