"""The viewer's web server: viser's, on one socket, behind a check of each request.

viser has no hook for such a check. It makes its server by `websockets.asyncio.server.serve`, which
here, while viser starts, is one that checks, and that has a socket which is bound already.
"""

import io
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from actuated_characters.viewer.web.request_check import RequestCheck, is_loopback
from msgs_config.errors import ConfigurationError

FIRST_PORT = 8080

_PORTS = 100  # that are tried
_NOT_FRAMED = {  # a page from elsewhere must not show this one within itself either
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "frame-ancestors 'none'",
}

Reject = Callable[[str], None]
"""Is told, in the server's thread, why a request was rejected."""


class ViewerServer(viser.ViserServer):
    """viser's server, which nothing makes public."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Do nothing: viser would let others in through a server of its makers'."""
        del verbose
        return None


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
    with _checked_serve(listening, check, reject) as used, redirect_stdout(io.StringIO()):
        server = ViewerServer(verbose=False)
    if not used:
        server.stop()
        raise ConfigurationError(
            f"viser {viser.__version__} starts its server in a way in which requests cannot be "
            "checked; install viser 1.1"
        )
    return server


def stop_server(server: ViewerServer) -> None:
    """Close all connections and the socket."""
    with redirect_stdout(io.StringIO()):
        server.stop()


@contextmanager
def _checked_serve(
    listening: socket.socket, check: RequestCheck, reject: Reject
) -> Iterator[list[bool]]:
    """Have `serve` check requests; yields a list that is not empty once it was called."""
    serve = websockets.asyncio.server.serve
    used: list[bool] = []

    def checked(
        handler: Any, host: object, port: object, *, process_request: Any, **options: Any
    ) -> Any:
        del host, port
        used.append(True)

        def process(connection: ServerConnection, request: Request) -> Response | None:
            headers = request.headers
            fault = check.find_fault(headers.get_all("Host"), headers.get_all("Origin"))
            if fault is not None:
                reject(fault)
                return connection.respond(HTTPStatus.FORBIDDEN, f"rejected: {fault}\n")
            response: Response | None = process_request(connection, request)
            if response is not None:
                response.headers.update(_NOT_FRAMED)
            return response

        return serve(handler, sock=listening, process_request=process, **options)

    websockets.asyncio.server.serve = checked  # type: ignore[assignment,misc]
    try:
        yield used
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]
