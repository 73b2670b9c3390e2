"""What a run in this process shows of its balls, as a bag does."""

from actuated_characters.runs.planned.throw_hits import States
from sim_node.physics.simulation import Simulation


def watch_states(states: States, simulation: Simulation) -> None:
    """Add the present state of a simulation."""
    states.append((simulation.characters[0].state.position, simulation.ball_motion()))
