"""Locks that a process can be forked with: a child never begins with one that is held."""

import os
import threading
from contextlib import AbstractContextManager


def fork_safe_lock() -> AbstractContextManager[bool]:
    """A lock that a thread may take again while it has it, and that a fork waits for.

    Of a process' threads a child has the one that forked alone; a lock that another one held
    would be held in it for good.
    """
    lock = threading.RLock()
    os.register_at_fork(
        before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release
    )
    return lock
