"""What stands between the network and viser: requests, messages, and the headers of responses."""

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import Any

import viser
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from actuated_characters.viewer.web.connection import MOST_BYTES, CheckedConnection, Reject
from actuated_characters.viewer.web.message_check import MessageCheck
from actuated_characters.viewer.web.page_parts import PageParts
from actuated_characters.viewer.web.request_check import RequestCheck

_PROTOCOL = f"viser-v{viser.__version__}"
_MOST_TARGET = 2000  # characters of a path and its query; browsers send no more
_MOST_SEGMENT = 255  # characters of a file's name

# viser's page is one file with scripts and styles within, decompresses itself (WebAssembly, whose
# glue evaluates text), keeps pictures and workers in blobs and data, and talks to its own server.
_POLICY = (
    "default-src 'none'",
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:",
    "style-src 'self' 'unsafe-inline'",
    "connect-src 'self' data: blob:",
    "img-src 'self' data: blob:",
    "font-src 'self' data:",
    "worker-src 'self' data: blob:",
    "base-uri 'none'",
    "form-action 'none'",
    "frame-ancestors 'none'",
)
_HEADERS = {
    "Content-Security-Policy": "; ".join(_POLICY),
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",  # or a page that came without these headers could be shown again
}
# The page of viser 1.1.1 fails, and stays empty, where a skinned mesh goes: as a character does, or
# all as the viewer is started anew. Loaded once more it shows what is there.
# The arrow keys would turn its camera, for which it listens at the document, and steer a character,
# for which it listens one element below: there they stop.
_ADDED_SCRIPT = b"""<script>
addEventListener("error", event => {
  if (event.message.includes("reading 'remove'")) location.reload();
});
document.documentElement.addEventListener("keydown", event => {
  if (event.code.startsWith("Arrow")) event.stopPropagation();
});
</script>"""
_STARTING_PAGE = "the viewer starts; this page comes again by itself\n"

Serve = Callable[[ServerConnection, Request], Response | None]
"""viser's own answer to a request; None where it takes the connection as a websocket."""


class ServerGate:
    """Checks requests and messages for one server; closed until viser is whole."""

    def __init__(self, check: RequestCheck, reject: Reject, parts: PageParts) -> None:
        self.reject, self._parts = reject, parts
        self._check = check
        self._messages: MessageCheck | None = None

    def open(self, messages: MessageCheck) -> None:
        """Let pages in, and their messages that this check finds no fault in."""
        self._messages = messages

    def options(self, process_request: Serve) -> dict[str, Any]:
        """Options of `websockets.asyncio.server.serve` by which it uses this gate."""
        logger = logging.Logger(__name__)  # a logger of its own: viser adds filters to it
        logger.addHandler(_Told(self.reject))
        return {
            "process_request": partial(self._process, process_request),
            "create_connection": partial(CheckedConnection, gate=self),
            "max_size": MOST_BYTES,
            "logger": logger,
        }

    def message_fault(self, raw: bytes | str, *, awaits_picture: bool) -> str | None:
        """The reason to drop a message, None if there is none."""
        assert self._messages is not None  # no connection is made before `open`
        return self._messages.find_fault(raw, awaits_picture=awaits_picture)

    def handle_error(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Tell of an error in a task of the server's event loop, which goes on."""
        del loop
        reason = context.get("exception") or context.get("message")
        self.reject(f"an error in the page's server: {reason!r}")

    def _process(
        self, serve: Serve, connection: ServerConnection, request: Request
    ) -> Response | None:
        response = self._response(serve, connection, request)
        if response is not None:
            for name, value in _HEADERS.items():
                response.headers[name] = value
        return response

    def _response(
        self, serve: Serve, connection: ServerConnection, request: Request
    ) -> Response | None:
        headers, respond = request.headers, connection.respond
        hosts, upgrades = headers.get_all("Host"), headers.get_all("Upgrade")
        fault = self._check.find_fault(hosts, headers.get_all("Origin"))
        fault = fault or self._check.find_target_fault(request.path, hosts[0])
        if fault is not None:
            self.reject(f"rejected a request: {fault}")
            return respond(HTTPStatus.FORBIDDEN, f"rejected: {fault}\n")
        if len(request.path) > _MOST_TARGET:
            return respond(HTTPStatus.REQUEST_URI_TOO_LONG, "the address is too long\n")
        if max(map(len, request.path.partition("?")[0].split("/"))) > _MOST_SEGMENT:
            return respond(HTTPStatus.NOT_FOUND, "there is no such page\n")
        if self._messages is None:
            response = respond(HTTPStatus.SERVICE_UNAVAILABLE, _STARTING_PAGE)
            response.headers["Retry-After"] = "1"
            response.headers["Refresh"] = "1"
            return response
        if upgrades and _PROTOCOL not in _protocols(request):
            return respond(HTTPStatus.BAD_REQUEST, f"this server speaks {_PROTOCOL}\n")
        text = self._parts.texts.get(request.path.partition("?")[0])
        if text is not None:
            response = respond(HTTPStatus.OK, text())
            del response.headers["Content-Type"]
            response.headers["Content-Type"] = "application/json"
            return response
        try:
            if "Accept-Encoding" in request.headers:  # what is zipped could not be added to
                del request.headers["Accept-Encoding"]
            page = serve(connection, request)
            return page if page is None else self._with_head(page)
        except Exception as error:  # a request that viser does not understand ends no connection
            self.reject(f"rejected a request: {error!r}")
            return respond(HTTPStatus.BAD_REQUEST, "this request is not understood\n")

    def _with_head(self, response: Response) -> Response:
        """A response, with more at the beginning of its head if it is a page."""
        before, head, after = response.body.partition(b"<head>")
        if head:
            body = b"".join((before, head, _ADDED_SCRIPT, self._parts.head(), after))
            response.body = body
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(body))
        return response


class _Told(logging.Handler):
    """Tells of failed connections in a line; not of broken handshakes, which any scan makes."""

    def __init__(self, reject: Reject) -> None:
        super().__init__(logging.WARNING)
        self._reject = reject

    def emit(self, record: logging.LogRecord) -> None:
        """Tell of an error of a connection."""
        error = record.exc_info[1] if record.exc_info else None
        if error is not None and record.getMessage() == "connection handler failed":
            self._reject(f"a page's connection has failed: {error!r}")


def _protocols(request: Request) -> list[str]:
    given = request.headers.get_all("Sec-WebSocket-Protocol")
    return [each.strip() for each in ",".join(given).split(",")]
