"""The one way in which functions are compiled."""

import hashlib
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache, partial
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

from msgs_config.geometry import scalars  # noqa: E402

_CONFIG: Any = numba.config
_CONFIG.reload_config()  # where somebody has imported numba before
_Function = TypeVar("_Function", bound=Callable[..., Any])
_HERE = Path(__file__).parent
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
            make: Any = numba.njit(
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


def _make_directory(directory: Path) -> bool:
    """Make a directory for compiled functions, saying what it is for; whether it is there."""
    if not directory.exists():
        _say_what_takes_long()
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(directory, os.W_OK)


@cache
def _say_what_takes_long() -> None:
    print("compiling what is computed often, once; it takes some seconds", file=sys.stderr)


def choose_cache_directory(sources: Iterable[Path], given: str = "") -> Path:
    """Where compiled functions are kept, another directory for each content of the sources.

    A function holds the code of those that it calls, and numba looks for changes in its own file
    alone: with one directory a change in another file would leave the old code in force.

    Args:
        sources: All files with functions that call each other.
        given: Directory that NUMBA_CACHE_DIR names; empty: beside the sources, or the user's
            cache where that cannot be written to.
    """
    digest = hashlib.sha256()
    for source in sorted(sources):
        digest.update(source.read_bytes())
    base = Path(given) if given else _HERE / "__pycache__"
    if not given and not os.access(_HERE, os.W_OK):
        cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        base = Path(cache) / "actuated_characters"
    return base / f"numba-{digest.hexdigest()[:16]}"


compiled = Compiler()
