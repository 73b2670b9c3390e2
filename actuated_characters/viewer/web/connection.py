"""The connection of one page: what comes is checked, and comes no faster than a page sends."""

import asyncio
from collections.abc import Callable
from typing import Any, Protocol

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode

MOST_BYTES = 1 << 16
"""Of a control message; the page's own have at most some hundreds."""
_MOST_PICTURE_BYTES = 1 << 25  # bytes of a message with a picture: a PNG of the page's window
_RATE, _BURST = 500.0, 500.0  # messages a second, and at once; a page sends at most some 200
_UNUSABLE_CODES = (CloseCode.PROTOCOL_ERROR, CloseCode.INVALID_DATA, CloseCode.MESSAGE_TOO_BIG)

Reject = Callable[[str], None]
"""Is told, in the server's thread, what was rejected, and why."""


class Gate(Protocol):
    """What a connection asks about each message."""

    reject: Reject

    def message_fault(self, raw: bytes | str, *, awaits_picture: bool) -> str | None:
        """The reason to drop a message, None if there is none."""


class CheckedConnection(ServerConnection):
    """A connection that hands on no message in which a gate finds a fault."""

    def __init__(self, *arguments: Any, gate: Gate, **options: Any) -> None:
        """`gate` checks the messages; the rest is the base class's."""
        super().__init__(*arguments, **options)
        self._gate = gate
        self._allowance, self._looked_at = _BURST, 0.0  # messages that may still come, s
        self._awaits_picture = False

    async def await_picture(self, *, awaits: bool) -> None:
        """Take messages with a picture from now on, or none any more.

        Raises:
            ConnectionClosed: the page has gone.
        """
        self._awaits_picture = awaits
        self.protocol.max_message_size = _MOST_PICTURE_BYTES if awaits else MOST_BYTES
        if awaits:
            # The limit of a frame is taken as soon as the one before was read: a pong is one.
            await (await self.ping())

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message without a fault; waits where they come too fast."""
        while True:
            await self._wait_for_allowance()
            try:
                raw = await super().recv(decode)
            except ConnectionClosed as closed:
                if closed.sent is not None and closed.sent.code in _UNUSABLE_CODES:
                    self._gate.reject(f"rejected a message: {closed.sent.reason}")
                raise
            fault = self._gate.message_fault(raw, awaits_picture=self._awaits_picture)
            if fault is None:
                return raw
            self._gate.reject(f"rejected a message: {fault}")

    async def _wait_for_allowance(self) -> None:
        """Wait until a page may send one more message; the network holds back the others."""
        now = asyncio.get_running_loop().time()
        self._allowance = min(_BURST, self._allowance + _RATE * (now - self._looked_at)) - 1.0
        self._looked_at = now
        if self._allowance < 0.0:
            await asyncio.sleep(-self._allowance / _RATE)
