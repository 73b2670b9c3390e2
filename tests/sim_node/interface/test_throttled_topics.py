"""Topics for displays: few of the messages, the same ones, and the last one in any case."""

import time

import numpy as np

from msgs_config.messages import topics
from msgs_config.runtime.throttle import THROTTLED_RATE
from tests.support.ros import Processes, SimulatorClient, tick_of

TICKS = 1500


def test_displays_get_few_states_the_last_of_them_and_as_they_are(
    processes: Processes, client: SimulatorClient
) -> None:
    shown = client.listen(topics.JOINT_STATES_THROTTLE)
    processes.simulator("pendulum", wait_for_subscribers=1)
    rng, state = np.random.default_rng(1), client.first_state()
    client.spin_until(lambda: shown.messages, "a first one")

    begun, before = time.monotonic(), len(shown)
    last = client.drive(state, TICKS, rng)
    seconds = time.monotonic() - begun
    client.spin_until(lambda: tick_of(last) in shown.ticks(), "the last one")

    assert len(shown) - before < seconds * THROTTLED_RATE + 3
    states = client.states.by_tick()
    assert all(
        states[tick].position == message.position for tick, message in shown.by_tick().items()
    )


def test_contacts_are_found_for_displays_in_their_ticks_alone(
    processes: Processes, client: SimulatorClient
) -> None:
    shown, begun = client.listen(topics.CONTACTS_THROTTLE), time.monotonic()
    processes.simulator("humanoid", wait_for_subscribers=1)
    rng, state = np.random.default_rng(1), client.first_state()

    while not any(message.joint_names for message in shown.messages):  # until it has fallen
        state = client.drive(state, 20, rng)

    assert len(shown) < (time.monotonic() - begun) * THROTTLED_RATE + 3
