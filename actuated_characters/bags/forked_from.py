"""Where a forked run comes from, as its bag, its summary and its parameters say it."""

import json
from dataclasses import asdict, dataclass
from typing import Any

from msgs_config.errors import ConfigurationError

KEY = "forked_from"
"""A parameter of the recorder; a key in `summary.json`, and in the custom data of the bag's
metadata, where the value is JSON."""


@dataclass(frozen=True)
class ForkedFrom:
    """The recording that a run was forked from, and the first state that may differ after it."""

    path: str  # path of the original's directory or bag
    state_hash: str  # hash of all of the original's states
    tick: int  # tick of the last state in common, up to which all are equal
    time: float  # time of that state, s since the first one

    def to_json(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self))

    def __str__(self) -> str:
        return f"{self.path} at {self.time:g} s (tick {self.tick}), state hash {self.state_hash}"


def read_forked_from(text: object) -> ForkedFrom | None:
    """What `to_json` wrote; None of anything else."""
    try:
        content: dict[str, Any] = json.loads(text) if isinstance(text, str) else {}
        return ForkedFrom(
            path=str(content["path"]),
            state_hash=str(content["state_hash"]),
            tick=int(content["tick"]),
            time=float(content["time"]),
        )
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def given_origin(text: str) -> dict[str, ForkedFrom]:
    """The origin in a text of the recorder's parameter, by its key; empty if none is given.

    Raises:
        ConfigurationError: the text is not one that `to_json` writes.
    """
    origin = read_forked_from(text)
    if text and origin is None:
        raise ConfigurationError(
            f"parameter '{KEY}' is {text!r}; it must be JSON with path, state_hash, tick and time"
        )
    return {} if origin is None else {KEY: origin}
