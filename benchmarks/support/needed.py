"""Ends a measurement in one line where an extra that it needs is not installed."""

import sys

from msgs_config.errors import ConfigurationError
from msgs_config.extras import require_extra


def need(what: str, *extras: str) -> None:
    """End the process, with how to get it, unless all these extras are installed."""
    try:
        for extra in extras:
            require_extra(extra, what)
    except ConfigurationError as error:
        sys.exit(f"error: {error}")
