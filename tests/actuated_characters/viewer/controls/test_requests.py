"""Requests to real nodes: what they respond, and what of many values in a row they are sent."""

from collections.abc import Iterator

import pytest
from rclpy.context import Context
from std_srvs.srv import SetBool

from actuated_characters.viewer.controls import requests as requests_module
from actuated_characters.viewer.controls.requests import Requests
from msgs_config.messages import topics
from tests.support.ros import Client, Processes

CONTROLLER = f"/{topics.CONTROLLER_NODE}"


@pytest.fixture
def client(context: Context) -> Iterator[Client]:
    client = Client(context)
    yield client
    client.close()


def poll_until(client: Client, requests: Requests, there: list[object], count: int = 1) -> None:
    def arrived() -> bool:
        requests.poll()
        return len(there) >= count

    client.spin_until(arrived, "a response")


def test_a_parameter_is_set_and_a_rejection_comes_in_the_nodes_words(
    processes: Processes, client: Client
) -> None:
    processes.controller("pendulum")
    requests, told = Requests(client.node), []

    requests.set(CONTROLLER, "law", "pd", told.append)
    poll_until(client, requests, told)
    requests.set(CONTROLLER, "law", "magic", told.append)
    poll_until(client, requests, told, 2)

    _, reason = client.set_parameter(CONTROLLER, "law", "magic")
    assert told == ["", reason]
    assert "magic" in reason
    assert client.get_parameters(CONTROLLER, ["law"]) == ["pd"]


def test_of_values_in_a_row_the_last_one_is_set(processes: Processes, client: Client) -> None:
    processes.controller("pendulum")
    requests, told = Requests(client.node), []

    for value in range(100):
        requests.set(CONTROLLER, "gain_scale.p", 0.01 * value, told.append)
    poll_until(client, requests, told, 2)

    assert told == ["", ""]  # the first value, and the last
    assert client.get_parameters(CONTROLLER, ["gain_scale.p"]) == [0.99]


def test_only_the_parameters_that_a_node_has_are_taken(
    processes: Processes, client: Client
) -> None:
    processes.controller("pendulum")
    requests, taken = Requests(client.node), []

    requests.get(CONTROLLER, ["law", "no.such", "gain_scale.d"], taken.append)
    poll_until(client, requests, taken)

    assert taken == [{"law": "stable_pd", "gain_scale.d": 1.0}]


def test_a_node_that_is_not_there_does_not_respond(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests_module, "_PATIENCE", 0.1)
    requests, told = Requests(client.node), []

    requests.set("/nowhere", "law", "pd", told.append)
    requests.trigger(SetBool, "/nowhere/pause", SetBool.Request(data=True), told.append)
    poll_until(client, requests, told, 2)

    assert told == ["it does not respond"] * 2
