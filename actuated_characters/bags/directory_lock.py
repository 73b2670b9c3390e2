"""A lock on a recording's directory while it is written, which ends with its process."""

import fcntl
import os
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path


class DirectoryLock:
    """Holds a directory until `release`, or until its process ends, however that happens."""

    def __init__(self, directory: Path) -> None:
        """Lock a directory.

        Raises:
            BlockingIOError: another lock holds it.
            OSError: there is no such directory, or no permission to look into it.
        """
        self._descriptor: int | None = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise
        except OSError:  # a file system without locks: then nothing is locked
            self.release()

    def release(self) -> None:
        """Let others lock it; releasing again does nothing."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with suppress(OSError):
                os.close(descriptor)


def is_locked(directory: Path) -> bool:
    """Whether another lock holds a directory; none can hold one that is not there."""
    try:
        DirectoryLock(directory).release()
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def find_writer(files: Collection[Path]) -> int | None:
    """Return the number of a process that has one of some files open to write, None if none has.

    The superuser alone sees the files of other users' processes.
    """
    wanted = {(status.st_dev, status.st_ino) for status in map(os.stat, files)}
    for process in Path("/proc").iterdir():
        if process.name.isdecimal():
            with suppress(OSError):  # the process has ended, or is another user's
                for descriptor in (process / "fd").iterdir():
                    with suppress(OSError):  # the file was closed meanwhile
                        status = descriptor.stat()
                        if (status.st_dev, status.st_ino) in wanted and _is_writable(descriptor):
                            return int(process.name)
    return None


def _is_writable(descriptor: Path) -> bool:
    """Whether an entry of /proc/PID/fd was opened to write; see proc(5)."""
    lines = (descriptor.parents[1] / "fdinfo" / descriptor.name).read_text().splitlines()
    flags = next(int(line.split()[1], 8) for line in lines if line.startswith("flags:"))
    return flags & os.O_ACCMODE != os.O_RDONLY
