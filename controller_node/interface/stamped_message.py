"""Decodes messages that count from a stamp on, and rejects those whose stamp cannot be."""

from typing import Any

from msgs_config.bus.stamped_subscription import PastStampError
from msgs_config.errors import MotionError
from msgs_config.messages import typed

_MAX_BYTES = 2**25  # bytes of a message
_LATEST_NS = 10**15  # ns that a stamp may be after that of the present state


def decode_stamped(raw: bytes, type_name: str, what: str, state_ns: int) -> tuple[Any, int]:
    """A message with a header, and the stamp in ns that it counts from; without one the state's.

    Raises:
        MessageError: the bytes are no such message.
        PastStampError: its stamp is over; begins with `what`, as the next.
        MotionError: it is too long, or its stamp is too late.
    """
    if len(raw) > _MAX_BYTES:
        raise MotionError(f"{what}: it has {len(raw)} bytes; it must have {_MAX_BYTES} or fewer")
    message = typed.decode(raw, type_name)
    return message, checked_start(message.header.stamp, what, state_ns)


def checked_start(stamp: Any, what: str, state_ns: int) -> int:
    """The stamp in ns that something counts from; without one that of the present state.

    Raises:
        PastStampError: it is over; begins with `what`, as the next.
        MotionError: it is too late.
    """
    start_ns = typed.nanoseconds(stamp) or state_ns
    if start_ns < state_ns:
        raise PastStampError(
            f"{what}: it begins at {start_ns} ns, which is over; it must be {state_ns} ns or "
            "later, or 0 for at once"
        )
    if start_ns > state_ns + _LATEST_NS or stamp.nanosec >= 10**9:
        raise MotionError(
            f"{what}: its stamp is {stamp.sec} s and {stamp.nanosec} ns; it must be a time, and "
            "within 1e6 s"
        )
    return start_ns
