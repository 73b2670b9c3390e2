"""The panel's controls on real nodes: what they show, what they set, and what comes at a reset."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from actuated_characters.viewer.controls.parameter_controls import ParameterControls
from actuated_characters.viewer.controls.requests import Requests
from actuated_characters.viewer.controls.shown_parameters import (
    CONTROLLER,
    SIMULATOR,
    shown_parameters,
)
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import (
    ViewerServer,
    open_socket,
    start_server,
    stop_server,
)
from msgs_config.messages import topics
from tests.support.physics import character
from tests.support.ros import Client, Processes
from tests.support.ros import SimulatorClient as Simulated

NODES = {name: f"/{name}" for name in (SIMULATOR, CONTROLLER)}


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    server = start_server(open_socket("127.0.0.1", 0), RequestCheck("127.0.0.1"), print)
    yield server
    stop_server(server)


class Hand:
    """Somebody at the page: sets controls by the names of their parameters."""

    def __init__(self, server: ViewerServer, client: Client) -> None:
        self.told: list[str] = []
        self._client, self._requests = client, Requests(client.node)
        self._set: dict[str, Callable[[Any], None]] = {}
        self.controls = ParameterControls(server.gui, self._requests, self._later, self.told.append)
        self.controls.choose(NODES, "", shown_parameters(character("humanoid")))

    def _later(self, function: Callable[..., None], value: Callable[[], Any]) -> Callable[..., Any]:
        (shown,) = function.args  # type: ignore[attr-defined]
        self._set[shown.name] = function

        del value

        async def change(event: object) -> None:
            del event

        return change

    def spin_until(self, done: Callable[[], Any], what: str) -> None:
        def step() -> bool:
            self._requests.poll()
            return bool(done())

        self._client.spin_until(step, what)

    def set(self, name: str, value: object) -> str:
        """Set a control, and wait for what is said of it."""
        count = len(self.told)
        self._set[name](value)
        self.spin_until(lambda: len(self.told) > count, f"a word on {name}")
        return self.told[count]


def test_the_clip_and_gravity_of_a_menu_come_with_the_next_reset(
    processes: Processes, client: Simulated, server: ViewerServer
) -> None:
    joints = ["root", *character("humanoid").layout.actuated_joint_names]
    # In real time: this client is slower than the simulation, and would lose what it waits for.
    processes.simulator(
        "humanoid", commanded_joints=joints, wait_for_subscribers=2, real_time_factor=1.0
    )
    processes.controller("humanoid", reference="clip", clip="walk")
    episode, references = (
        client.listen(topics.EPISODE),
        client.listen(topics.REFERENCE.of(CONTROLLER)),
    )
    client.spin_until(lambda: references.messages, "it runs")
    hand = Hand(server, client)

    assert hand.set("clip", "run") == "clip run: at the next reset"
    assert hand.set("gravity", 1.62) == "gravity 1.62: at the next reset"
    hand.spin_until(
        lambda: client.get_parameters(SIMULATOR, ["initial_state"]) == ["reference"],
        "that it begins where the reference does",
    )
    for node in NODES:
        hand.spin_until(
            lambda node=node: client.get_parameters(node, ["gravity"]) == [1.62], "gravity"
        )
    before = len(episode)
    assert client.reset().success

    client.spin_until(lambda: len(episode) > before, "the next episode")
    begin = episode.last.stamp
    for heard, what in ((references, "its reference"), (client.states, "its state")):
        client.spin_until(
            lambda heard=heard: any(each.header.stamp == begin for each in heard.messages), what
        )
    reference = next(each for each in references.messages if each.header.stamp == begin)
    state = next(each for each in client.states.messages if each.header.stamp == begin)
    assert np.allclose(state.position, reference.position, rtol=0.0, atol=1e-9)
    of_walk = references.messages[0].position
    assert not np.allclose(reference.position, of_walk, rtol=0.0, atol=0.1)  # another clip's


def test_a_slider_of_no_number_is_told_and_of_a_whole_one_sends_whole_ones(
    processes: Processes, client: Simulated, server: ViewerServer
) -> None:
    processes.simulator("lift", wait_for_subscribers=1)
    processes.controller("lift")
    hand = Hand(server, client)
    texts = ("controller_node.law 0 3 1 Law", "sim_node.step_count 1 20 1 Steps")

    hand.controls.choose(NODES, "", shown_parameters(character("lift"), texts))
    hand.spin_until(lambda: any("no slider can show" in told for told in hand.told), "a word")
    steps = next(h for s, h in hand.controls._controls.values() if s.name == "step_count")
    hand.spin_until(lambda: steps.visible, "the other one")

    hand.set("step_count", 5.0)  # the other one may be told of once more in between
    hand.spin_until(lambda: "step_count 5: set" in hand.told, "that it is set")
    assert client.get_parameters(SIMULATOR, ["step_count"]) == [5]


def test_a_value_that_is_refused_is_told_and_the_one_in_force_comes_back(
    processes: Processes, client: Simulated, server: ViewerServer
) -> None:
    processes.controller("humanoid", reference="clip", clip="walk")
    hand = Hand(server, client)
    handle = next(h for s, h in hand.controls._controls.values() if s.name == "behaviour")
    hand.spin_until(lambda: handle.visible and handle.value == "tracking", "the value in force")

    sentence = hand.set("behaviour", "pursuit")

    assert sentence.startswith("behaviour pursuit: ")
    assert "opponent" in sentence
    assert client.get_parameters(CONTROLLER, ["behaviour"]) == ["tracking"]


def test_a_limit_that_is_none_is_the_sliders_end(
    processes: Processes, client: Simulated, server: ViewerServer
) -> None:
    processes.controller("humanoid", reference="clip", clip="walk")
    hand = Hand(server, client)
    handle = hand.controls._controls[CONTROLLER, "effort_limit.root"][1]
    hand.spin_until(lambda: handle.visible, "the root's limit")
    assert handle.value == 2000.0

    assert hand.set("effort_limit.root", 300.0) == "effort_limit.root 300: set"
    assert client.get_parameters(CONTROLLER, ["effort_limit.root"]) == [300.0]
    assert hand.set("effort_limit.root", 2000.0) == "effort_limit.root inf: set"
    assert client.get_parameters(CONTROLLER, ["effort_limit.root"]) == [float("inf")]
