"""Requests to the services of other nodes, whose responses come when they come."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future

_PATIENCE = 10.0  # s
_NO_RESPONSE = "it does not respond"

Respond = Callable[[Any | None], None]
"""Takes a service's response; None where there is none."""


@dataclass
class _Request:
    client: Client
    content: Any
    respond: Respond
    deadline: float
    future: Future | None = None


class Requests:
    """The open requests of a node, whose executor must have its turns."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, Client] = {}
        self._open: list[_Request] = []
        self._settings: dict[tuple[str, str], tuple[object, Callable[[str], None]]] = {}
        self._being_set: set[tuple[str, str]] = set()

    def call(self, service: type, name: str, content: Any, respond: Respond) -> None:
        """Send a request to a service as soon as it is there."""
        if name not in self._clients:
            self._clients[name] = self._node.create_client(service, name)
        request = _Request(self._clients[name], content, respond, time.monotonic() + _PATIENCE)
        self._open.append(request)

    def get(
        self, node: str, names: Sequence[str], take: Callable[[dict[str, object]], None]
    ) -> None:
        """Ask a node for parameters; `take` is given those that it has.

        Of which it has any is asked first: a node that lacks one of several says nothing of others.
        """

        def respond(known: Sequence[str], response: Any | None) -> None:
            values = [] if response is None else response.values
            pairs = zip(known, map(parameter_value_to_python, values), strict=False)
            take({name: value for name, value in pairs if value is not None})

        def ask(response: Any | None) -> None:
            has = set() if response is None else set(response.result.names)
            known = [name for name in names if name in has]
            if not known:
                take({})
                return
            request = GetParameters.Request(names=known)
            self.call(GetParameters, f"{node}/get_parameters", request, partial(respond, known))

        self.call(ListParameters, f"{node}/list_parameters", ListParameters.Request(), ask)

    def set(self, node: str, name: str, value: object, tell: Callable[[str], None]) -> None:
        """Set a parameter, of several values in a row the last; `tell` gets the node's reason.

        That is empty if the node has taken the value.
        """
        self._settings[node, name] = value, tell
        self._set_next(node, name)

    def _set_next(self, node: str, name: str) -> None:
        key = node, name
        if key in self._being_set or key not in self._settings:
            return
        value, tell = self._settings.pop(key)
        self._being_set.add(key)
        message = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[message])

        def respond(response: Any | None) -> None:
            self._being_set.discard(key)
            results = [] if response is None else response.results
            tell(results[0].reason if results else _NO_RESPONSE)
            self._set_next(node, name)

        self.call(SetParameters, f"{node}/set_parameters", request, respond)

    def trigger(self, service: type, name: str, content: Any, tell: Callable[[str], None]) -> None:
        """Call a service of std_srvs; `tell` gets its message."""
        self.call(service, name, content, partial(_tell_message, tell))

    def poll(self) -> None:
        """Send what can be sent, and hand out the responses that have come."""
        now = time.monotonic()
        for request in list(self._open):
            if request.future is None and request.client.service_is_ready():
                request.future = request.client.call_async(request.content)
            is_done = request.future is not None and request.future.done()
            if not is_done and now < request.deadline:
                continue
            self._open.remove(request)
            if request.future is not None and not is_done:
                request.client.remove_pending_request(request.future)
            done = request.future if is_done else None
            request.respond(None if done is None else done.result())


def _tell_message(tell: Callable[[str], None], response: Any | None) -> None:
    tell(_NO_RESPONSE if response is None else response.message)
