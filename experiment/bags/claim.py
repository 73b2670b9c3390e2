"""A mark on a recording's directory that somebody is writing there, gone with its process."""

import fcntl
import os
from contextlib import suppress
from pathlib import Path


class Claim:
    """Holds a directory until `release`, or until its process ends, however that happens."""

    def __init__(self, directory: Path) -> None:
        """Claim a directory.

        Raises:
            BlockingIOError: another claim holds it.
            OSError: there is no such directory, or no permission to look into it.
        """
        self._descriptor: int | None = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise
        except OSError:  # a file system without locks: then nobody is told, and nobody is stopped
            self.release()

    def release(self) -> None:
        """Let others claim it; releasing again does nothing."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with suppress(OSError):
                os.close(descriptor)
