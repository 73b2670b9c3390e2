"""The viewer's web server: viser's, on one socket, behind a check of each request and message.

viser has no hook for such checks. It makes its server by `websockets.asyncio.server.serve`, which
here, while viser starts, is one that checks, and that has a socket which is bound already.
"""

import asyncio
import io
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import viser
import websockets.asyncio.server
from websockets.exceptions import ConnectionClosed

from actuated_characters.viewer.web.connection import CheckedConnection, Reject
from actuated_characters.viewer.web.gate import ServerGate
from actuated_characters.viewer.web.message_check import MessageCheck
from actuated_characters.viewer.web.page_parts import PageParts
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.request_check import RequestCheck, is_loopback
from msgs_config.errors import ConfigurationError, RecordingError

FIRST_PORT = 8080

_PORTS = 100  # ports that are tried
_PATIENCE = 10.0  # s for a page to respond to a ping


class ViewerServer(viser.ViserServer):
    """viser's server, which nothing makes public."""

    parts: PageParts
    """What its page has beside viser's own."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Do nothing: viser would let others in through a server of its makers'."""
        del verbose
        return None

    @contextmanager
    def awaiting_picture(self, client: viser.ClientHandle) -> Iterator[None]:
        """Have a client's page send a picture, which is larger than any other message.

        Raises:
            RecordingError: the page has gone, or does not respond.
        """
        connection = self._websock_server._live_connections.get(client.client_id)
        if not isinstance(connection, CheckedConnection):
            raise RecordingError("the browser has gone")
        self._await_picture(connection, awaits=True)
        try:
            yield
        finally:
            self._await_picture(connection, awaits=False)

    def _await_picture(self, connection: CheckedConnection, *, awaits: bool) -> None:
        awaiting = connection.await_picture(awaits=awaits)
        try:
            asyncio.run_coroutine_threadsafe(awaiting, self._event_loop).result(_PATIENCE)
        except (ConnectionClosed, TimeoutError) as error:
            raise RecordingError(f"the browser does not respond: {error}") from error


def open_socket(host: str, port: int | None) -> socket.socket:
    """A socket that listens; without a port on the first one from 8080 on that is free.

    Raises:
        ConfigurationError: the port is in use, or the address is not one of this machine's.
    """
    numbers = [port] if port is not None else range(FIRST_PORT, FIRST_PORT + _PORTS)
    reason = ""
    for number in numbers:
        try:
            family, _, _, _, address = socket.getaddrinfo(
                host, number, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
            return socket.create_server(address, family=family)
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
    ports = f"port {numbers[0]}" if port is not None else f"ports {numbers[0]} to {numbers[-1]}"
    raise ConfigurationError(
        f"cannot listen on {host}, {ports}: {reason}; --port takes another port, --host an address"
    )


def describe_address(host: str, port: int) -> list[str]:
    """The page's address; and a warning where others than this machine can reach it."""
    place = f"[{host}]" if ":" in host else host
    address = f"http://{place}:{port}"
    if is_loopback(host):
        return [address]
    return [
        address,
        f"listening on {host}: all who reach port {port} of this machine can watch, push and set "
        "parameters; without --host only this machine can",
    ]


def start_server(listening: socket.socket, check: RequestCheck, reject: Reject) -> ViewerServer:
    """Start the server in a thread.

    Raises:
        ConfigurationError: the installed viser starts its server in a way that cannot be checked.
    """
    parts = PageParts()
    gate = ServerGate(check, reject, parts)
    unchecked = ConfigurationError(
        f"viser {viser.__version__} starts its server in a way in which requests cannot be "
        "checked; install viser 1.1"
    )
    if not viser.__version__.startswith("1.1."):
        raise unchecked
    with _guarded_serve(listening, gate) as used, redirect_stdout(io.StringIO()):
        server = ViewerServer(verbose=False)
    if not used:
        server.stop()
        raise unchecked
    server.parts = parts
    server._event_loop.set_exception_handler(gate.handle_error)
    gate.open(MessageCheck(server))
    return server


@contextmanager
def serving(host: str, port: int | None) -> Iterator[tuple[ViewerServer, Rejections, list[str]]]:
    """A server until the end of the block, what it rejects, and the lines that say where it is.

    Raises:
        ConfigurationError: as `open_socket` and `start_server` do.
    """
    rejections = Rejections()
    listening = open_socket(host, port)
    server = start_server(listening, RequestCheck(host), rejections.note)
    try:
        yield server, rejections, describe_address(host, listening.getsockname()[1])
    finally:
        stop_server(server)


def stop_server(server: ViewerServer) -> None:
    """Close all connections and the socket."""
    with redirect_stdout(io.StringIO()):
        server.stop()


@contextmanager
def _guarded_serve(listening: socket.socket, gate: ServerGate) -> Iterator[list[bool]]:
    """Have `serve` use a gate; yields a list that is not empty once it was called."""
    serve = websockets.asyncio.server.serve
    used: list[bool] = []

    def guarded(
        handler: Any, host: object, port: object, *, process_request: Any, **options: Any
    ) -> Any:
        del host, port
        used.append(True)
        return serve(handler, sock=listening, **{**options, **gate.options(process_request)})

    websockets.asyncio.server.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield used
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]
