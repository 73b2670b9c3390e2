"""Parameters of the controller that change with the next episode, beside a real simulator."""

import json
from typing import Any

import pytest

from msgs_config.messages import topics
from msgs_config.messages.configuration import SINCE
from tests.support.physics import character
from tests.support.ros import ControllerClient, Process, Processes, SimulatorClient, tick_of

SIMULATOR, CONTROLLER = topics.SIM_NODE, topics.CONTROLLER_NODE


def go_on(client: SimulatorClient, ticks: int = 20) -> int:
    """Wait for some more ticks; returns the last one."""
    last = tick_of(client.states.last) + ticks if client.states.messages else ticks
    client.spin_until(
        lambda: client.states.messages and tick_of(client.states.last) >= last, f"tick {last}"
    )
    return tick_of(client.states.last)


def has_said(process: Process, part: str) -> bool:
    return any(part in line for line in process.stderr.splitlines())


def newest(messages: Any) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(messages.last.data)
    return content


def test_gravity_of_both_changes_at_a_reset(processes: Processes, client: SimulatorClient) -> None:
    configurations = client.listen(topics.CONFIGURATION.of(CONTROLLER))
    processes.simulator(real_time_factor=1.0)
    controller = processes.controller()
    go_on(client)
    for node in (CONTROLLER, SIMULATOR):
        assert client.set_parameter(node, "gravity", 1.62) == (True, "")
    go_on(client)
    client.spin_until(lambda: configurations.messages, "the controller's configuration")
    assert newest(configurations)["parameters"]["gravity"] == 9.81

    client.reset()
    go_on(client)

    assert newest(client.configuration)["parameters"]["gravity"] == 1.62
    told = newest(configurations)
    assert told["parameters"]["gravity"] == 1.62
    assert told[SINCE] is not None
    assert not has_said(controller, "answered")


def test_a_gravity_of_one_side_alone_is_waited_for_on_the_other(
    processes: Processes, client: SimulatorClient
) -> None:
    """Nothing ends: the run goes on when both are the same."""
    processes.simulator(real_time_factor=1.0)
    controller = processes.controller()
    go_on(client)
    assert client.set_parameter(SIMULATOR, "gravity", 1.62) == (True, "")
    client.reset()
    client.spin_until(lambda: has_said(controller, "no state is answered"), "the reason")
    (line,) = [line for line in controller.stderr.splitlines() if "no state" in line]
    assert "'gravity'" in line
    client.spin_until(lambda: not client.states.messages[-1].effort, "a first state")
    first = tick_of(client.states.last)

    assert client.set_parameter(CONTROLLER, "gravity", 1.62) == (True, "")

    assert go_on(client) > first + 10
    assert controller.exit_code is None


@pytest.mark.parametrize(
    ("body", "name", "value", "words"),
    [
        ("humanoid", "clip", "limbo", "limbo"),
        ("humanoid", "library", ["limbo"], None),  # which behaviour tracking does not read
        ("pendulum", "behaviour", "active_ragdoll", "behaviour"),
        ("pendulum", "behaviour", "pursuit", "pursuit"),
        ("pendulum", "reference", "clip", "clip"),
        ("pendulum", "reference", "keyframes", "keyframes"),
        ("pendulum", "gravity", -1.0, "gravity"),
        ("pendulum", "planner", "recorded", "planner"),
    ],
)
def test_what_cannot_be_is_refused_at_once(
    processes: Processes,
    simulator: ControllerClient,
    body: str,
    name: str,
    value: object,
    words: str | None,
) -> None:
    given: dict[str, object] = {"reference": "clip"} if body == "humanoid" else {}
    processes.controller(body, **given)
    before = simulator.get_parameters(CONTROLLER, [name])

    taken, reason = simulator.set_parameter(CONTROLLER, name, value)

    assert taken == (words is None), reason
    if words is not None:
        assert words in reason and "\n" not in reason
        assert simulator.get_parameters(CONTROLLER, [name]) == before


def test_a_behaviour_that_knows_the_plane_alone_is_refused_on_a_terrain(
    processes: Processes, client: SimulatorClient
) -> None:
    terrain = "package://pybullet_data/plane.urdf"
    processes.simulator("humanoid", terrain=terrain, real_time_factor=1.0)
    processes.controller("humanoid", reference="clip", root_assistance=False)
    go_on(client, 5)

    taken, reason = client.set_parameter(CONTROLLER, "behaviour", "reactive")

    assert not taken
    assert "'terrain'" in reason


def test_in_real_time_a_reset_changes_the_reference_too(
    processes: Processes, client: SimulatorClient
) -> None:
    references = client.listen(topics.REFERENCE.of(CONTROLLER))
    processes.simulator(mode="realtime")
    processes.controller(reference="step", step__size=0.2, step__time=0.0)
    (rest,) = character("pendulum").rest_position

    def is_at(position: float) -> bool:
        found = references.messages
        return bool(found) and found[-1].position[0] == pytest.approx(position)

    client.spin_until(lambda: is_at(rest + 0.2), "the step")  # the simulator waits for nobody
    assert client.set_parameter(CONTROLLER, "reference", "hold") == (True, "")
    begun = go_on(client)
    assert is_at(rest + 0.2)

    client.reset()

    client.spin_until(lambda: is_at(rest), "the rest pose")
    assert tick_of(references.last) > begun
