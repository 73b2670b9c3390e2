"""How long the calls of one method take."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch


@contextmanager
def timed(owner: type, method: str) -> Iterator[list[float]]:
    """Durations in s of a method's calls within the block, in a list that grows."""
    durations: list[float] = []
    function = getattr(owner, method)

    def timing(*arguments: Any, **options: Any) -> Any:
        started = time.perf_counter()
        result = function(*arguments, **options)
        durations.append(time.perf_counter() - started)
        return result

    with patch.object(owner, method, timing):
        yield durations
