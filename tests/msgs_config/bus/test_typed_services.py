"""Services of any type over the middleware, with an answer that comes later."""

from typing import Any

from rclpy.context import Context
from std_srvs.srv import SetBool

from msgs_config.bus.dds import DdsNode
from msgs_config.bus.node import Answer
from tests.support.ros import SimulatorClient


def test_a_response_is_sent_when_its_answer_is_given(
    context: Context, client: SimulatorClient
) -> None:
    node, given = DdsNode("server", context=context), list[Answer]()

    def fill(request: Any, response: Any) -> Answer:
        response.success, response.message = request.data, "later"
        given.append(Answer())
        return given[-1]

    node.offer_typed("typed", "std_srvs/srv/SetBool", fill)
    executor = node.make_executor([node])
    future = client.begin_call(SetBool, "server/typed", SetBool.Request(data=True))
    client.spin_until(lambda: executor.serve_pending() or given, "the call")
    assert not future.done()

    given[0].give(True)
    client.spin_until(lambda: executor.serve_pending() or future.done(), "the response")

    assert (future.result().success, future.result().message) == (True, "later")
    executor.close()
    node.destroy_node()
