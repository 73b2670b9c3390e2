"""`sensor_msgs/JointState` to and from its serialised form, fast where names do not change.

Names are constant, so the bytes up to and with them are kept, and only the stamp and the doubles
are written or read.
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.errors import LayoutError, MessageError
from msgs_config.messages.cdr import (
    CDR_LITTLE_ENDIAN,
    JOINT_STATE,
    LITTLE_ENDIAN,
    NAMES_START,
    STAMP_START,
    encode_head,
    encode_names,
    gaps_before,
    read_message,
    with_stamp,
)
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.state import StampedState

_MAX_KEPT_SENDERS = 16
_EMPTY = np.zeros(0)


class JointArrays(NamedTuple):
    """A decoded JointState: names and arrays in the sender's order; absent arrays are empty."""

    stamp_ns: int
    names: tuple[str, ...]
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray
    frame_id: str = ""


class JointStateEncoder:
    """Serialises JointState messages that all have the same names and `frame_id`."""

    def __init__(self, names: Sequence[str], frame_id: str = "") -> None:
        self._head = encode_head(names, frame_id)
        self._lengths: tuple[int, ...] = ()  # lengths of the last message's lists

    def encode(
        self,
        stamp_ns: int,
        position: FloatArray = _EMPTY,
        velocity: FloatArray = _EMPTY,
        effort: FloatArray = _EMPTY,
    ) -> bytes:
        """The serialised message; each array is (n,) or empty."""
        lengths = len(position), len(velocity), len(effort)
        if lengths != self._lengths:
            self._lengths = lengths
            self._gaps = gaps_before(len(self._head), (position, velocity, effort))
        stamped = with_stamp(self._head, stamp_ns)
        a, b, c = self._gaps
        lists = (a, position.tobytes(), b, velocity.tobytes(), c, effort.tobytes())
        return stamped + b"".join(lists)


class JointStateDecoder:
    """Reads serialised JointState messages; fast for senders whose names it has seen."""

    def __init__(self) -> None:
        self._known_forms: dict[bytes, _Form] = {}  # by the bytes of frame_id and names

    def decode(self, raw: bytes) -> JointArrays:
        """The message's content.

        Raises:
            MessageError: the bytes are no JointState.
        """
        for head, form in self._known_forms.items():
            if raw.startswith(head, NAMES_START) and raw.startswith(CDR_LITTLE_ENDIAN):
                if (arrays := form.read(raw)) is not None:
                    return arrays
                break
        stamp_ns, frame_id, names, lists = read_message(raw, JOINT_STATE)
        position, velocity, effort = lists
        arrays = JointArrays(stamp_ns, names, position, velocity, effort, frame_id)
        head = encode_names(names, frame_id)
        if raw.startswith(head, NAMES_START) and raw.startswith(CDR_LITTLE_ENDIAN):
            # each start of a simulator is a new sender
            if head not in self._known_forms and len(self._known_forms) == _MAX_KEPT_SENDERS:
                del self._known_forms[next(iter(self._known_forms))]
            self._known_forms[head] = _Form(arrays, NAMES_START + len(head))
        return arrays


class _Form:
    """How messages look that have the names of one that was read, and lists of its lengths."""

    def __init__(self, like: JointArrays, names_end: int) -> None:
        """Of a message whose names end at an offset in bytes."""
        self._like = like
        lists = like.position, like.velocity, like.effort
        self._counts = tuple(map(len, lists))
        numbers, starts, end = f"<iI{names_end - NAMES_START}x", [], names_end
        for gap, values in zip(gaps_before(names_end, lists), lists, strict=True):
            numbers += f"I{len(gap) - LITTLE_ENDIAN.length.size + values.nbytes}x"
            starts.append(end + len(gap))
            end += len(gap) + values.nbytes
        self._numbers, self._size = struct.Struct(numbers), end
        # All doubles are read at once, with the gaps between the lists, each as long as one double.
        whole = [start for start, count in zip(starts, self._counts, strict=True) if count]
        self._start = min(whole, default=end)
        firsts = [(start - self._start) // 8 for start in starts]
        self._slices = [
            slice(first, first + count) if count else slice(0)
            for first, count in zip(firsts, self._counts, strict=True)
        ]

    def read(self, raw: bytes) -> JointArrays | None:
        """The content of a message; None if its lists have other lengths."""
        if len(raw) != self._size:
            return None
        seconds, nanoseconds, *counts = self._numbers.unpack_from(raw, STAMP_START)
        if tuple(counts) != self._counts:
            return None
        count = (self._size - self._start) // 8
        doubles = np.frombuffer(raw, LITTLE_ENDIAN.double, count, self._start).astype(np.float64)
        position, velocity, effort = self._slices
        return JointArrays(
            seconds * NANOSECONDS_PER_SECOND + nanoseconds,
            self._like.names,
            doubles[position],
            doubles[velocity],
            doubles[effort],
            self._like.frame_id,
        )


def state_in_layout(layout: JointLayout, arrays: JointArrays) -> StampedState:
    """A received state in the layout's order, matched by name.

    Raises:
        LayoutError: a name is unknown, or a degree of freedom is missing.
        MessageError: an array's length is not that of the names.
    """
    stamp_ns, names, position, velocity, effort, _ = arrays
    in_order = names == layout.dof_names
    indices = None if in_order else layout.indices(names)
    if indices is not None and len(indices) != layout.size:
        missing = next(name for name in layout.dof_names if name not in names)
        raise LayoutError(f"degree of freedom '{missing}' is missing")
    lengths = {len(position), len(velocity), len(effort) or layout.size}
    if lengths != {layout.size}:
        raise MessageError(f"{layout.size} names but arrays of {sorted(lengths)} entries")
    if indices is not None:
        order = np.argsort(indices)
        position, velocity = position[order], velocity[order]
        effort = effort[order] if len(effort) else effort
    return StampedState(stamp_ns, position, velocity, effort if len(effort) else None)
