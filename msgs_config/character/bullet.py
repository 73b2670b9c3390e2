"""PyBullet without its output: the import, a private engine, and a URDF loaded into it.

PyBullet prints on import and while it reads a URDF, from C, past Python's streams. The output is
kept and shown only with the error that it explains.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from msgs_config.character.model import UrdfOptions
from msgs_config.character.urdf.engine_text import write_engine_urdf
from msgs_config.errors import CharacterError


@contextmanager
def captured_output() -> Iterator[IO[bytes]]:
    """Divert the process' standard output and error into a file."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile() as sink:
        os.dup2(sink.fileno(), 1)
        os.dup2(sink.fileno(), 2)
        try:
            yield sink
        finally:
            os.dup2(saved[0], 1)
            os.dup2(saved[1], 2)
            os.close(saved[0])
            os.close(saved[1])


with captured_output():
    import pybullet

__all__ = ["connect", "load_urdf", "pybullet"]


def connect() -> int:
    """Start a private engine without a window; returns its client number."""
    return int(pybullet.connect(pybullet.DIRECT))


def load_urdf(client: int, loading: UrdfOptions) -> int:
    """Load a URDF, each link after its parent; returns the body's number.

    Raises:
        CharacterError: the engine refuses the file, or one of its meshes does not exist.
    """
    # not URDF_MAINTAIN_LINK_ORDER: it crashes where a file lists a link before its parent
    flags = 0
    if loading.self_collision:
        flags |= pybullet.URDF_USE_SELF_COLLISION
        flags |= pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_ALL_PARENTS
    if loading.inertia_from_file:
        flags |= pybullet.URDF_USE_INERTIA_FROM_FILE
    with tempfile.TemporaryDirectory() as directory, captured_output() as output:
        copy = Path(directory) / "model.urdf"
        copy.write_text(write_engine_urdf(loading, Path(directory)), encoding="utf-8")
        # an engine that caches files would read an old version of a file that was edited
        pybullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)
        try:
            return int(
                pybullet.loadURDF(
                    str(copy),
                    useFixedBase=loading.fixed_base,
                    globalScaling=loading.scale,
                    flags=flags,
                    physicsClientId=client,
                )
            )
        except pybullet.error as error:
            output.seek(0)
            lines = output.read().decode(errors="replace").strip().splitlines()
            reason = f": {lines[-1]}" if lines else ""
            raise CharacterError(f"{loading.urdf_path}: not a usable URDF{reason}") from error
