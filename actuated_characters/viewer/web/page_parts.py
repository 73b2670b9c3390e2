"""What the viewer's page has beside viser's own: scripts, styles, and texts that they fetch."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

_ELEMENTS = {".js": "script", ".css": "style"}


@dataclass
class PageParts:
    """Parts of the page of one server; what is added counts for pages that are loaded later."""

    files: list[Path] = field(default_factory=list)
    """Scripts and styles in a page's head, before viser's."""
    texts: dict[str, Callable[[], str]] = field(default_factory=dict)
    """JSON by the path of its address; made in the server's thread at each request."""

    def head(self) -> bytes:
        """The scripts and styles as they stand in a page's head."""
        parts = [(_ELEMENTS[file.suffix], file.read_text(encoding="utf-8")) for file in self.files]
        return "".join(f"<{name}>\n{text}</{name}>" for name, text in parts).encode()
