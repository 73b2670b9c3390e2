"""The numbers and pictures of a glTF 2.0 document: one buffer, with views and accessors."""

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from character_motion.gltf.kinds import COMPONENTS, WIDTHS

_TYPES = {width: name for name, width in WIDTHS.items()}
_CODES = {component: code for code, component in COMPONENTS.items()}
_ALIGNMENT = 4

VERTICES, INDICES = 34962, 34963
"""What a view is for, where it is of a mesh."""

Component: TypeAlias = Literal["<f4", "<u4", "<u2", "|u1"]
"""How a number is stored: single precision, or an unsigned integer of four, two or one bytes."""

AddEntry: TypeAlias = Callable[[str, dict[str, Any]], int]
"""Adds an entry to a part of the document, and returns its number there."""


class NumberBuffer:
    """One buffer, of which parts are added one after the other."""

    def __init__(self, add_entry: AddEntry) -> None:
        """`add_entry` is told each view and each accessor."""
        self._add_entry = add_entry
        self._content = bytearray()

    def __bytes__(self) -> bytes:
        return bytes(self._content)

    def __len__(self) -> int:
        return len(self._content)

    def add_view(self, content: bytes, target: int | None = None) -> int:
        """Add bytes, from the next multiple of four on, and return the number of their view."""
        self._content += b"\0" * (-len(self._content) % _ALIGNMENT)
        view: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": len(self._content),
            "byteLength": len(content),
        }
        if target is not None:
            view["target"] = target
        self._content += content
        return self._add_entry("bufferViews", view)

    def add_rows(
        self,
        rows: NDArray[Any],
        target: int | None = None,
        *,
        component: Component = "<f4",
        bounds: bool = False,
    ) -> int:
        """Add rows (m, width) of numbers, and return the number of their accessor.

        Args:
            rows: The numbers; a matrix (4, 4) is a row of 16, column by column.
            target: What they are for, `VERTICES` or `INDICES`.
            component: How each is stored; a row must take a multiple of four bytes where m > 1.
            bounds: Whether the accessor says the least and the greatest of each column.
        """
        stored = np.ascontiguousarray(rows, dtype=component)
        accessor: dict[str, Any] = {
            "bufferView": self.add_view(stored.tobytes(), target),
            "componentType": _CODES[component],
            "count": len(stored),
            "type": _TYPES[stored.shape[1]],
        }
        if bounds:
            accessor |= {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
        return self._add_entry("accessors", accessor)
