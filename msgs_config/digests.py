"""What files are, so that it can be said that one is not what it was."""

import hashlib
from functools import cache
from pathlib import Path


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's content, hexadecimal; read once for each version of it.

    Raises:
        OSError: it does not exist, or cannot be read.
    """
    status = path.stat()
    return _of_version(path, status.st_mtime_ns, status.st_size)


@cache
def _of_version(path: Path, modified_ns: int, size: int) -> str:
    del modified_ns, size
    return hashlib.sha256(path.read_bytes()).hexdigest()
