"""Free ROS domains, so that two runs on a machine never receive each other's messages."""

import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from msgs_config.errors import ConfigurationError

_DOMAINS = range(1, 102)  # above 101 the ports lie among those that Linux gives out by itself
_FIRST_PORT, _PORTS_A_DOMAIN, _UNICAST = 7400, 250, 10  # DDSI-RTPS 2.3, section 9.6.1.1
_LOOKED_FOR = 4  # participants of a domain; without multicast there is no port of all


@contextmanager
def own_domain() -> Iterator[int]:
    """A free domain id, held under a file lock until the context ends.

    Raises:
        ConfigurationError: every domain is taken.
    """
    directory = Path(tempfile.gettempdir()) / f"actuated_characters_domains_{os.getuid()}"
    directory.mkdir(exist_ok=True)
    start = os.getpid()  # spread: many runs at once seldom try the same domain
    for offset in range(len(_DOMAINS)):
        domain = _DOMAINS[(start + offset) % len(_DOMAINS)]
        path = directory / str(domain)
        lock = _lock(path)
        if lock is None:
            continue
        try:
            if _is_silent(domain):
                yield domain
                return
        finally:
            path.unlink(missing_ok=True)
            os.close(lock)
    raise ConfigurationError("every ROS domain is taken; set ROS_DOMAIN_ID to share one")


def _lock(path: Path) -> int | None:
    """The descriptor of an open, locked file; None if another process holds its lock."""
    descriptor = os.open(path, os.O_CREAT | os.O_RDWR, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # the former holder may have removed the file between opening and locking it here
        if path.stat().st_ino == os.fstat(descriptor).st_ino:
            return descriptor
    except OSError:
        pass
    os.close(descriptor)
    return None


def _is_silent(domain: int) -> bool:
    """Whether none of the ports is taken where the domain's first participants listen."""
    first = _FIRST_PORT + _PORTS_A_DOMAIN * domain
    meeting_points = [first] + [first + _UNICAST + 2 * index for index in range(_LOOKED_FOR)]
    return all(_is_free(port) for port in meeting_points)


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True
