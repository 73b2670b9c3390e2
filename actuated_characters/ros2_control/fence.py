"""Whether a controller manager has taken what was published to it."""

from typing import Protocol

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future


class Fence(Protocol):
    """Is raised behind a message, and passed when the other side has taken that."""

    @property
    def is_there(self) -> bool:
        """Whether there is somebody to pass it."""

    def raise_again(self) -> None:
        """Raise it, whether or not it was passed before."""

    @property
    def is_passed(self) -> bool:
        """Whether the other side has passed it."""


class ServiceFence:
    """A call of a service that is answered by who takes the messages.

    A node of rclcpp answers `~/get_parameters` and runs the callbacks of its subscriptions in one
    group, one after the other, and of what is ready the subscriptions first. A message and a
    request that one process sends to another one come in the order in which they were sent. So the
    answer says that the message was taken.
    """

    def __init__(self, node: Node, other: str) -> None:
        """Before the node `other`, named from the namespace of this one."""
        self._client = node.create_client(GetParameters, f"{other}/get_parameters")
        self._answer: Future | None = None
        self.service = self._client.srv_name

    @property
    def is_there(self) -> bool:
        """Whether the other node is there."""
        return bool(self._client.service_is_ready())

    def raise_again(self) -> None:
        """Call, and forget an earlier call."""
        if self._answer is not None and not self._answer.done():
            self._client.remove_pending_request(self._answer)
        self._answer = self._client.call_async(GetParameters.Request())

    @property
    def is_passed(self) -> bool:
        """Whether the last call was answered."""
        return self._answer is not None and bool(self._answer.done())
