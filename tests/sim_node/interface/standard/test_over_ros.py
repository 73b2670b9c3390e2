"""The services and the action over topics, where `simulation_interfaces` is installed."""

from typing import Any

import pytest
from rclpy.action import ActionClient

from tests.support.ros import Processes, SimulatorClient

simulation_interfaces = pytest.importorskip("simulation_interfaces", exc_type=ImportError)

OK, FAILED = 1, 4
PLAYING, PAUSED, QUITTING = 1, 2, 3


class Caller:
    """Calls services of `sim_node`."""

    def __init__(self, client: SimulatorClient) -> None:
        from simulation_interfaces import srv

        self._client, self._types = client, srv

    def __call__(self, service: str, kind: str, **fields: Any) -> Any:
        service_type = getattr(self._types, kind)
        request = service_type.Request(**fields)
        return self._client.call(service_type, f"sim_node/{service}", request)


def test_services_and_action_do_what_they_say(
    processes: Processes, client: SimulatorClient
) -> None:
    from simulation_interfaces.action import SimulateSteps
    from simulation_interfaces.msg import SimulationState

    # in real time ticks need no commands
    node = processes.simulator("pendulum", mode="realtime")
    call = Caller(client)

    features = call("get_simulator_features", "GetSimulatorFeatures").features
    assert 33 in features.features and features.spawn_formats == ["urdf"]
    assert call("get_entities", "GetEntities").entities == ["pendulum"]
    state = call("get_entity_state", "GetEntityState", entity="pendulum").state
    assert state.header.frame_id == "world" and state.pose.orientation.w == 1.0
    spawned = call("spawn_entity", "SpawnEntity", name="apple", **uri_of("ball"))
    assert (spawned.result.result, spawned.entity_name) == (OK, "apple")

    refused = call("step_simulation", "StepSimulation", steps=3).result
    assert refused.result == FAILED and "paused" in refused.error_message
    paused = call("set_simulation_state", "SetSimulationState", state=SimulationState(state=PAUSED))
    assert paused.result.result == OK
    assert call("step_simulation", "StepSimulation", steps=3).result.result == OK

    told: list[Any] = []
    actions = ActionClient(client.node, SimulateSteps, "sim_node/simulate_steps")
    client.spin_until(actions.server_is_ready, "the action")
    sent = actions.send_goal_async(
        SimulateSteps.Goal(steps=4), feedback_callback=lambda each: told.append(each.feedback)
    )
    client.spin_until(sent.done, "the goal's acceptance")
    result = sent.result().get_result_async()
    client.spin_until(result.done, "the goal's result")
    assert result.result().result.result.result == OK
    client.spin_until(lambda: len(told) == 4, "feedback of each step")
    assert [each.remaining_steps for each in told] == [3, 2, 1, 0]

    assert call("reset_simulation", "ResetSimulation", scope=255).result.result == OK
    assert call("get_entities", "GetEntities").entities == ["pendulum"]
    ended = call(
        "set_simulation_state", "SetSimulationState", state=SimulationState(state=QUITTING)
    )
    assert ended.result.result == OK
    assert node.wait() == 0


def uri_of(uri: str) -> dict[str, Any]:
    """The field that a request of SpawnEntity has for it: version 2 has a message there."""
    from simulation_interfaces.srv import SpawnEntity

    if hasattr(SpawnEntity.Request(), "uri"):
        return {"uri": uri}
    from simulation_interfaces.msg import Resource

    return {"entity_resource": Resource(uri=uri)}
