"""Which HTTP requests the viewer's server takes: none that a web page from elsewhere can make.

A browser lets any page open a websocket to this machine, and names the page in the header `Origin`.
A page whose own name was made to resolve to this machine (DNS rebinding) has the right origin, but
its name in the header `Host`. And viser's page takes scene and scripts from wherever its own
address says (`?websocket=`, `?playbackPath=`), to which a page from elsewhere can lead a browser.
"""

import socket
from collections.abc import Sequence
from ipaddress import ip_address
from urllib.parse import parse_qsl, urlsplit

LOOPBACK = "127.0.0.1"

_LOCAL = "localhost"
_SCHEMES = ("http", "https")
_SOURCES = ("websocket", "playbackPath")  # what viser's page takes from the query of its address
_SCHEMES_OF_SOURCES = ("http", "https", "ws", "wss")
_MAX_SHOWN = 100  # characters of a header that a line shows


class RequestCheck:
    """Checks the headers of requests for a server that listens on one address."""

    def __init__(self, host: str) -> None:
        """`host` is the address or name on which the server listens."""
        self._names = {_LOCAL}
        self._only_loopback = is_loopback(host)
        if not self._only_loopback:
            own = socket.gethostname().lower()
            self._names |= {host.lower(), own, f"{own}.local"}

    def find_fault(self, hosts: Sequence[str], origins: Sequence[str]) -> str | None:
        """The reason to reject a request with these headers `Host` and `Origin`, None if none.

        Only browsers send an origin; a program on this machine could do anything without us.
        """
        if len(hosts) != 1 or not self._is_own(hosts[0]):
            return f"it asks for the host {_shown(hosts)}, which is not this server's"
        if not origins:
            return None
        if len(origins) != 1 or not _is_of(origins[0], hosts[0]):
            return f"it comes from a page of {_shown(origins)}, not of this server"
        return None

    def find_target_fault(self, target: str, host: str) -> str | None:
        """The reason to reject a request's target, path and query, None if there is none.

        `host` is its header `Host`, which was found to be this server's.
        """
        query = target.partition("?")[2]
        for name, source in parse_qsl(query, keep_blank_values=True):
            if name in _SOURCES and not _leads_to(source, host):
                return f"its {name} is {_shown([source])}, not this server"
        return None

    def _is_own(self, host: str) -> bool:
        name = _name(host)
        if name is None or name in self._names:
            return name is not None
        try:
            address = ip_address(name)
        except ValueError:
            return False
        return address.is_loopback or not self._only_loopback


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a server on this address or name."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == _LOCAL


def _is_of(origin: str, host: str) -> bool:
    """Whether a page's origin is the server that the header `Host` names, its port included."""
    scheme, separator, place = origin.partition("://")
    return scheme in _SCHEMES and bool(separator) and place.lower() == host.lower()


def _leads_to(source: str, host: str) -> bool:
    """Whether an address is one of a host, whole and plain: browsers read others in many ways."""
    place = f"{source.lower()}/"
    return any(place.startswith(f"{each}://{host.lower()}/") for each in _SCHEMES_OF_SOURCES)


def _name(host: str) -> str | None:
    """The name or address in a header `Host`, without port and brackets; None if it has none."""
    try:
        parts = urlsplit(f"//{host}")
        is_plain = parts.netloc == host and parts.username is None and parts.port != 0
    except ValueError:
        return None
    return parts.hostname if is_plain else None


def _shown(values: Sequence[str]) -> str:
    return repr(", ".join(values)[:_MAX_SHOWN]) if values else "no name"
