"""The one way in which functions are compiled here."""

import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")  # its elementary functions are its own

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """Compile a function; a division by zero gives infinity or NaN, as in arrays."""
    made = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath=False)(function)
    return cast(_Function, made)
