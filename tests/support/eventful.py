"""Runs in which something happens, made in the process: pushes, contacts, a reset, a pause."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from actuated_characters.runs.plan import RunPlan, make_plan
from controller_node.parameters import make_controller
from msgs_config.messages import configuration, topics
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches
from msgs_config.parameters import Values
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.bags import RawMessage, raw_configuration, raw_references, raw_states
from tests.support.bags import add_timed as add_timed
from tests.support.bags import write_timed as write_timed
from tests.support.physics import read_wrenches

CONTROLLER = topics.CONFIGURATION.of(topics.CONTROLLER_NODE)
START_NS = 1_700_000_000_000_000_000  # of the log times
MS = 1_000_000


@dataclass
class Eventful:
    """A run, and what a recorder hears of it, each with the wall time at which it came."""

    plan: RunPlan
    states: list[StampedState] = field(default_factory=list)
    references: list[StampedReference] = field(default_factory=list)
    contacts: list[WrenchArrays] = field(default_factory=list)
    pushes: list[WrenchArrays] = field(default_factory=list)
    log_times_ns: list[int] = field(default_factory=list)  # of the states
    from_controller: list[RawMessage] = field(default_factory=list)

    def messages(self, *, contacts: bool = True) -> list[tuple[RawMessage, int]]:
        """All messages with their wall times."""
        first, times = self.log_times_ns[0], self.log_times_ns
        by_stamp = {s.stamp_ns: t for s, t in zip(self.states, times, strict=True)}
        timed = [(raw_configuration(self.plan), first - 2 * MS)]
        timed += [(message, first - MS) for message in self.from_controller]
        timed += list(zip(raw_states(self.plan, self.states), times, strict=True))
        references = raw_references(self.plan, self.references)
        timed += [
            (message, by_stamp[reference.stamp_ns])
            for message, reference in zip(references, self.references, strict=True)
        ]
        for topic, wrenches in (
            (topics.APPLIED_WRENCH, self.pushes),
            (topics.CONTACTS, self.contacts if contacts else []),
        ):
            timed += [((topic, encode_wrenches(w)), by_stamp[w.stamp_ns]) for w in wrenches]
        return sorted(timed, key=lambda each: each[1])


def eventful_run(
    character: str,
    ticks: int,
    reference: dict[str, object] | None = None,
    *,
    pushed: Sequence[tuple[int, int, str, tuple[float, float, float]]] = (),
    reset_after: int | None = None,
    pause_after: int | None = None,
    pause_s: float = 2.0,
    tick_ns: int = MS,
    **simulator: object,
) -> Eventful:
    """Run simulator and controller in this process.

    `pushed` is first tick (from 0), ticks, link and force; the others are counts of ticks.
    """
    plan = make_plan(character, 1.0, reference or {"reference": "hold"}, simulator, {})
    run = Eventful(plan)
    controller = make_controller(plan.character, plan.reference, plan.controller)
    names = [link.name for link in plan.character.links]
    setup = make_character_setup(plan.character, plan.simulator)
    now = START_NS
    with Simulation([setup], make_simulation_settings(plan.simulator)) as simulation:
        simulation.watches_contacts = True
        (simulated,) = simulation.characters
        episode_ns = simulated.state.stamp_ns
        run.states.append(simulated.state)
        run.log_times_ns.append(now)
        for tick in range(ticks):
            now += tick_ns + (round(1e9 * pause_s) if tick == pause_after else 0)
            if tick == reset_after:
                simulation.reset()
                episode_ns = simulation.stamp_ns
            else:
                effort, desired = controller.compute_effort(simulated.state, episode_ns)
                run.references.append(desired)
                acting = [
                    ExternalWrench(
                        names.index(link), np.array((*force, 0.0, 0.0, 0.0)), np.zeros(3), 0, 1
                    )
                    for first, count, link, force in pushed
                    if first <= tick < first + count
                ]
                simulation.step([np.where(simulated.commanded, effort, 0.0)], [acting])
            run.states.append(simulated.state)
            run.log_times_ns.append(now)
            pushes, contacts = read_wrenches(simulated)
            assert contacts is not None
            run.pushes.append(pushes)
            run.contacts.append(contacts)
    run.from_controller.append(raw_controller(plan, plan.controller))
    return run


def raw_controller(plan: RunPlan, values: Values, since_ns: int | None = None) -> RawMessage:
    text = configuration.describe(plan.character, values, since_ns)
    return CONTROLLER, serialize_message(String(data=text))
