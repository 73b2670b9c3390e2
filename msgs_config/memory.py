"""The memory of an object as bytes: what it needs to go on, without what it was made of.

What an equal one is made of, such as a character or a motion library, is there as well where it is
to go on: the bytes refer to it by number, and are small.

The bytes are a pickle, and to read one is to trust who made it. So they are sealed with a key that
only the programs of this user on this machine have, and no others are opened.
"""

import hashlib
import hmac
import inspect
import io
import os
import pickle
import secrets
import zlib
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.errors import RecordingError

_PLAIN_MODULES = ("builtins", "collections", "functools", "pathlib")
_SEAL_BYTES = 32


class OnePart:
    """A part in whose place an object goes on with another one, whatever that is made of.

    No memory refers to what is in it.
    """


class MemoryFormat:
    """Writes and reads the memory of an object, or of another that was made in the same way."""

    def __init__(self, *parts: object) -> None:
        """Number what the object is made of, and all that is in it.

        They come in the same order for each that is made so, and may not change but for what is
        computed anew whenever it is needed.
        """
        counter = _Counter()
        counter.dump(parts)
        self._parts = counter.found
        self._numbers = {id(each): number for number, each in enumerate(self._parts)}
        kinds = [(type(each).__qualname__, getattr(each, "shape", ())) for each in self._parts]
        self._kinds = zlib.crc32(repr(kinds).encode())

    def write(self, owner: object) -> bytes:
        """The memory of an object that is made of the parts, compressed and sealed."""
        file = io.BytesIO()
        _Writer(file, self._numbers).dump((self._kinds, owner))
        packed = zlib.compress(file.getvalue(), 1)  # most of a planner's cannot be made smaller
        return _seal_of(packed) + packed

    def read(self, sealed: bytes) -> Any:
        """An object with that memory, made of the parts here.

        Raises:
            RecordingError: another user's programs wrote it, or one with other parts.
        """
        if not is_own(sealed):
            raise RecordingError(
                "a keyframe of another user or machine is not opened; a fork with --from-start "
                "needs none"
            )
        try:
            raw = zlib.decompress(sealed[_SEAL_BYTES:])
            kinds, owner = _Reader(io.BytesIO(raw), self._parts).load()
        except Exception as error:  # what other versions wrote raises anything
            raise RecordingError(f"a keyframe cannot be read: {error}") from error
        if kinds != self._kinds:
            raise RecordingError("a keyframe cannot be read: it is of other parameters or files")
        return owner


def is_own(sealed: bytes) -> bool:
    """Whether a memory was written by a program of this user on this machine."""
    return hmac.compare_digest(sealed[:_SEAL_BYTES], _seal_of(sealed[_SEAL_BYTES:]))


def _seal_of(packed: bytes) -> bytes:
    return hmac.digest(_key(), packed, hashlib.sha256)


@cache
def _key() -> bytes:
    """This user's key, made when it is first needed; if it cannot be kept, the process's own."""
    state = os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    file = Path(state, "actuated_characters", "keyframes.key")
    new = secrets.token_bytes(_SEAL_BYTES)
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        own = file.with_name(f"{file.name}.{os.getpid()}")
        own.touch(mode=0o600)
        try:
            own.write_bytes(new)
            os.link(own, file)  # fails if another process was faster
        finally:
            own.unlink()
    with suppress(OSError):
        kept = file.read_bytes()
        if len(kept) == _SEAL_BYTES:
            return kept
    return new


class _Counter(pickle.Pickler):
    """Finds arrays and objects of all classes but Python's own, as a pickle comes by them."""

    def __init__(self) -> None:
        super().__init__(io.BytesIO(), pickle.HIGHEST_PROTOCOL)
        self.found: list[object] = []
        self._known: set[int] = set()

    def persistent_id(self, each: object) -> bool | None:
        """Note an object; it stays in the pickle, so that what is in it is found as well.

        What is in a `OnePart` is not: another one may take its place.
        """
        is_plain = type(each).__module__ in _PLAIN_MODULES or isinstance(
            each, np.generic | np.dtype
        )
        if not is_plain and id(each) not in self._known:
            self._known.add(id(each))
            self.found.append(each)
        return True if isinstance(each, OnePart) else None

    def reducer_override(self, each: object) -> Any:
        """Leave out what was computed once it was asked for: it is not there from the start."""
        if isinstance(each, type):
            return NotImplemented
        kind: Any = type(each)
        cached = _cached_properties(kind).intersection(getattr(each, "__dict__", ()))
        if not cached:
            return NotImplemented
        reduced: Any = each.__reduce_ex__(pickle.HIGHEST_PROTOCOL)
        made, given, state = reduced[:3]
        return made, given, {name: state[name] for name in state if name not in cached}


@cache
def _cached_properties(kind: type) -> frozenset[str]:
    """The names under which objects of a class keep what they were asked for once."""
    names = {name for each in kind.__mro__ for name in vars(each)}
    return frozenset(
        name
        for name in names
        if isinstance(inspect.getattr_static(kind, name, None), cached_property)
    )


class _Writer(pickle.Pickler):
    """Writes the number of what is known."""

    def __init__(self, file: io.BytesIO, numbers: dict[int, int]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._numbers = numbers

    def persistent_id(self, each: object) -> int | None:
        """The number of an object; None if it is to be written itself."""
        return self._numbers.get(id(each))


class _Reader(pickle.Unpickler):
    """Finds what is known by its number."""

    def __init__(self, file: io.BytesIO, parts: list[object]) -> None:
        super().__init__(file)
        self._parts = parts

    def persistent_load(self, number: Any) -> object:
        """The object of a number."""
        return self._parts[number]
