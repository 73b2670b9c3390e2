"""The one way in which functions are compiled here."""

import hashlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar, cast

os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")  # SVML has its own elementary functions

import numba

from controller_node.references import offsets
from msgs_config.geometry import scalars

_CONFIG: Any = numba.config
_Function = TypeVar("_Function", bound=Callable[..., Any])
_HERE = Path(__file__).parent
SOURCES = (
    *_HERE.glob("*.py"),
    Path(offsets.__file__),  # compiled functions come from here; a test compares
    Path(scalars.__file__),
)
"""All files with functions that are compiled here."""


def compiled(function: _Function) -> _Function:
    """Compile a function; a division by zero gives infinity or NaN, as in arrays."""
    given, _CONFIG.CACHE_DIR = _CONFIG.CACHE_DIR, str(_CACHE)  # read as numba decorates
    try:
        made = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath=False)(function)
    finally:
        _CONFIG.CACHE_DIR = given
    return cast(_Function, made)


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


_CACHE = choose_cache_directory(SOURCES, _CONFIG.CACHE_DIR)
