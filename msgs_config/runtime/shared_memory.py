"""Removes what killed processes have left of Fast DDS in shared memory.

Fast DDS gives each participant a segment, `fastrtps_` and 16 hexadecimal digits, of half a MiB. Its
process holds an exclusive lock on a file of that name and `_el` as long as it lives, whichever way
it ends; a process that is killed leaves both. The digits are random, so that no name is ever used
again. Files of ports (`fastrtps_port7413`) are left alone: the next process of the same
domain takes up their names, and could do so at this very moment.
"""

import fcntl
import os
import re
import time
from contextlib import suppress
from pathlib import Path

DIRECTORY = Path("/dev/shm")
LEAST_AGE = 5.0  # s; a process needs some microseconds from the file to the lock
_SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")
_LOCK = "_el"
_TRIAL_BYTES = 1  # size of a segment without a lock, which only tries whether shared memory works


def remove_orphans(directory: Path = DIRECTORY) -> list[str]:
    """Remove the segments of this user whose processes have ended; returns their names.

    Whatever cannot be read or removed stays.
    """
    removed = []
    with suppress(OSError):
        names = {name.removesuffix(_LOCK) for name in os.listdir(directory)}
        for name in sorted(filter(_SEGMENT.fullmatch, names)):
            with suppress(OSError):
                if _remove(directory / name, directory / (name + _LOCK)):
                    removed.append(name)
    return removed


def _remove(segment: Path, lock: Path) -> bool:
    """Remove a segment and its lock's file, if both are this user's and the lock is free."""
    present = [file for file in (segment, lock) if os.path.lexists(file)]
    if not all(map(_may_go, present)):
        return False
    if lock not in present:
        is_orphan = segment.stat().st_size <= _TRIAL_BYTES
        return is_orphan and _unlink(present)
    descriptor = os.open(lock, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # BlockingIOError: its process lives
        return _unlink(present)
    finally:
        os.close(descriptor)


def _may_go(file: Path) -> bool:
    found = file.lstat()
    is_file = file.is_file() and not file.is_symlink()
    return is_file and found.st_uid == os.geteuid() and time.time() - found.st_mtime > LEAST_AGE


def _unlink(files: list[Path]) -> bool:
    for file in files:
        file.unlink(missing_ok=True)
    return True
