"""The one way in which functions are compiled."""

import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

from llvmlite.binding import get_host_cpu_features

_LEVEL, _FEATURES = "x86-64-v3", ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")

# numba reads these as it is imported.
os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")  # SVML has its own elementary functions
if all(get_host_cpu_features().get(name) for name in _FEATURES):
    # Code for a level of processors rather than for the one that is here is shared by the machines
    # that share a disk or an image. No result depends on it.
    os.environ.setdefault("NUMBA_CPU_NAME", _LEVEL)
    if os.environ["NUMBA_CPU_NAME"] == _LEVEL:
        os.environ.setdefault("NUMBA_CPU_FEATURES", "")

import numba  # noqa: E402
from numba.core import event  # noqa: E402

from msgs_config.geometry import scalars  # noqa: E402

_CONFIG: Any = numba.config
_NJIT: Any = numba.njit  # its annotations differ from version to version
_CONFIG.reload_config()  # where somebody has imported numba before
_Function = TypeVar("_Function", bound=Callable[..., Any])
_HERE = Path(__file__).parent
_OURS = re.compile("numba-[0-9a-f]{16}")
_MONTH_S = 30 * 24 * 3600
SOURCES = (*_HERE.glob("*.py"), Path(scalars.__file__))
"""All files with functions that are compiled here; a test compares."""


class Compiler:
    """A decorator that compiles a function; a division by zero gives infinity or NaN.

    Where functions are compiled that call others of other files, all of these are its sources.
    """

    def __init__(self, *sources: Path) -> None:
        """`sources` are the files with compiled functions beside those of this folder."""
        self.sources = (*SOURCES, *sources)
        self.cache = choose_cache_directory(self.sources, _CONFIG.CACHE_DIR)
        self._is_kept = _make_directory(self.cache)
        _announcer.files.update(map(str, self.sources))

    def __call__(self, function: _Function) -> _Function:
        """Compile a function for the types that it is called with."""
        return self._compile(function, None)

    def inlined(self, function: _Function) -> _Function:
        """Compile a function into those that call it: large tuples are not handed over then."""
        return self._compile(function, None, is_inlined=True)

    def of(self, signature: object) -> Callable[[_Function], _Function]:
        """Compile a function for these types alone, before it is called.

        Arguments that are no such are a TypeError, and never compile anything more.
        """
        return partial(self._compile, signature=signature)

    def _compile(self, function: _Function, signature: Any, is_inlined: bool = False) -> _Function:
        given, _CONFIG.CACHE_DIR = _CONFIG.CACHE_DIR, str(self.cache)  # read as numba decorates
        try:
            make = _NJIT(
                signature,
                nogil=True,
                cache=self._is_kept,
                error_model="numpy",
                fastmath=False,
                forceinline=is_inlined,
            )
            return cast(_Function, make(function))
        finally:
            _CONFIG.CACHE_DIR = given


class _Announcer(event.Listener):  # type: ignore[misc,unused-ignore]  # annotated in some versions
    """Says, once, what takes so long when a function of ours is compiled."""

    def __init__(self) -> None:
        self.files: set[str] = set()
        self._has_said = False

    def on_start(self, happened: Any) -> None:
        """Numba begins to compile a function."""
        file = happened.data["dispatcher"].py_func.__code__.co_filename
        if file in self.files and not self._has_said:
            self._has_said = True
            print("compiling what is computed often, once; it takes some seconds", file=sys.stderr)

    def on_end(self, happened: Any) -> None:
        """Numba has compiled it."""


_announcer = _Announcer()
event.register("numba:compile", _announcer)


def choose_cache_directory(sources: Iterable[Path], given: str = "") -> Path:
    """Where compiled functions are kept, another directory for each content of the sources.

    A function holds the code of those that it calls, and numba looks for changes in its own file
    alone: with one directory a change in another file would leave the old code in force.

    numba reads no code where it cannot write. So what is kept there is copied to the user's cache.

    Args:
        sources: All files with functions that call each other.
        given: Directory that NUMBA_CACHE_DIR names; empty: beside the sources.
    """
    digest = hashlib.sha256()
    for source in sorted(sources):
        digest.update(source.read_bytes())
    base = Path(given) if given else _HERE / "__pycache__"
    directory = base / f"numba-{digest.hexdigest()[:16]}"
    if _can_write(directory):
        return directory
    users = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    copy = users / "actuated_characters" / directory.name
    if directory.is_dir() and not copy.exists():
        with suppress(OSError):
            copy.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=copy.parent) as folder:
                whole = Path(shutil.copytree(directory, Path(folder) / copy.name))
                whole.rename(copy)  # so that another process finds all of it or nothing
    return copy


def _can_write(directory: Path) -> bool:
    """Whether a directory can be written to, or made."""
    there = next(each for each in (directory, *directory.parents) if each.exists())
    return os.access(there, os.W_OK)


def _make_directory(directory: Path) -> bool:
    """Make a directory for compiled functions; whether it is there.

    What was compiled of other contents of the sources, and was not asked for in a month, goes.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        os.utime(directory)
    except OSError:
        return False
    for other in directory.parent.glob("numba-*"):
        with suppress(OSError):  # another process may be removing it
            if _OURS.fullmatch(other.name) and other.stat().st_mtime < time.time() - _MONTH_S:
                shutil.rmtree(other, ignore_errors=True)
    return os.access(directory, os.W_OK)


compiled = Compiler()
