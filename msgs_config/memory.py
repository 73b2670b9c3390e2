"""The memory of an object as bytes: what it needs to go on, without what it was made of.

What an equal one is made of, such as a character or a motion library, is there as well where it is
to go on: the bytes refer to it by number, and are small. They are a pickle that may name nothing
but the packages that it is of, numpy's arrays, and containers: reading one from a stranger runs no
code of his.
"""

import inspect
import io
import pickle
import zlib
from collections.abc import Callable
from types import FunctionType, MethodType
from typing import Any

import numpy as np

from msgs_config.errors import RecordingError

_MOST_BYTES = 1 << 28  # unpacked; a planner's are 2 MB
_PLAIN = {
    "builtins": {"complex", "frozenset", "set"},
    "collections": {"OrderedDict", "defaultdict", "deque"},
    "functools": {"partial"},
    "numpy": {"dtype", "ndarray"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.numeric": {"_frombuffer"},
    "numpy.core.multiarray": {"_reconstruct", "scalar"},  # before numpy 2
    "numpy.core.numeric": {"_frombuffer"},
}


class MemoryFormat:
    """Writes and reads the memory of an object, or of another that was made in the same way."""

    def __init__(self, packages: tuple[str, ...], *parts: object) -> None:
        """Number what the object is made of, and all that is in it.

        Args:
            packages: Names of modules and packages whose classes and functions it may consist of.
            parts: What the object is made of, in the same order for each that is made so. It may
                not change but for what it computes anew whenever it needs that.
        """
        self._packages = packages
        counter = _Counter(packages)
        counter.dump(parts)
        self._parts = counter.found
        kinds = [(type(each).__qualname__, getattr(each, "shape", ())) for each in self._parts]
        self._kinds = zlib.crc32(repr(kinds).encode())
        self._numbers = {id(each): number for number, each in enumerate(self._parts)}

    def write(self, owner: object) -> bytes:
        """The memory of an object that is made of the parts."""
        file = io.BytesIO()
        _Writer(file, self._numbers).dump((self._kinds, owner))
        return file.getvalue()

    def read(self, raw: bytes) -> Any:
        """An object with that memory, made of the parts here.

        Raises:
            RecordingError: the bytes are none that `write` made with such parts.
        """
        try:
            kinds, owner = _Reader(io.BytesIO(raw), self._packages, self._parts).load()
        except Exception as error:  # foreign bytes raise anything
            raise RecordingError(f"a keyframe cannot be read: {error}") from error
        if kinds != self._kinds:
            raise RecordingError("a keyframe cannot be read: it is of other parameters or files")
        return owner


def pack(raw: bytes) -> bytes:
    """Bytes, compressed."""
    return zlib.compress(raw)


def unpack(packed: bytes) -> bytes:
    """What was compressed. Raises RecordingError if it is damaged, or too large."""
    unpacker = zlib.decompressobj()
    try:
        raw = unpacker.decompress(packed, _MOST_BYTES)
    except zlib.error as error:
        raise RecordingError(f"a keyframe cannot be read: {error}") from error
    if not unpacker.eof:
        raise RecordingError("a keyframe cannot be read: it is cut off, or too large")
    return raw


def _is_of(module: str, packages: tuple[str, ...]) -> bool:
    return any(module == each or module.startswith(f"{each}.") for each in packages)


class _Counter(pickle.Pickler):
    """Finds the objects of some packages, and arrays, in the order in which a pickle has them."""

    def __init__(self, packages: tuple[str, ...]) -> None:
        super().__init__(io.BytesIO(), pickle.HIGHEST_PROTOCOL)
        self.found: list[object] = []
        self._packages = packages
        self._known: set[int] = set()

    def persistent_id(self, each: object) -> None:
        """Note an object; it stays in the pickle, so that what is in it is found as well."""
        if isinstance(each, type | FunctionType) or id(each) in self._known:
            return
        if isinstance(each, np.ndarray) or _is_of(type(each).__module__, self._packages):
            self._known.add(id(each))
            self.found.append(each)


class _Writer(pickle.Pickler):
    """Writes the number of what is known."""

    def __init__(self, file: io.BytesIO, numbers: dict[int, int]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._numbers = numbers

    def persistent_id(self, each: object) -> int | None:
        """The number of an object; None if it is to be written itself."""
        return self._numbers.get(id(each))

    def reducer_override(self, each: object) -> Any:
        """Write a method by its name: `getattr`, as pickles have it, would reach everything."""
        if isinstance(each, MethodType):
            return _method, (each.__self__, each.__func__.__name__)
        return NotImplemented


class _Reader(pickle.Unpickler):
    """Reads a pickle that names classes and functions of some packages."""

    def __init__(self, file: io.BytesIO, packages: tuple[str, ...], parts: list[object]) -> None:
        super().__init__(file)
        self._packages, self._parts = packages, parts

    def persistent_load(self, number: Any) -> object:
        """The object of a number."""
        return self._parts[number]

    def find_class(self, module: str, name: str) -> Any:
        """A class or function. Raises ValueError if the pickle may not name it."""
        if (module, name) == (_method.__module__, _method.__name__):
            return _method
        if name in _PLAIN.get(module, ()):
            return super().find_class(module, name)
        if _is_of(module, self._packages) and "." not in name:
            found = super().find_class(module, name)
            if isinstance(found, type | FunctionType) and found.__module__ == module:
                return found
        raise ValueError(f"it names {module}.{name}")


def _method(owner: object, name: str) -> Callable[..., Any]:
    """A method of an object. Raises ValueError if it has none of that name."""
    if not isinstance(inspect.getattr_static(type(owner), name, None), FunctionType):
        raise ValueError(f"it names a method {name}")
    method: Callable[..., Any] = getattr(owner, name)
    return method
