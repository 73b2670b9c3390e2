"""PyBullet without its output: the import, a private engine, and a URDF loaded into it.

PyBullet prints on import and while it reads a URDF, from C, past Python's streams. The output is
kept and shown only with the error that it explains. It reads numbers by the C library's locale,
which therefore is "C" wherever it reads a file.
"""

import operator
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar, NoReturn

from msgs_config.character.model import UrdfOptions
from msgs_config.errors import CharacterError, ClosedError, SimulationError
from msgs_config.runtime.fork_safe import fork_safe_lock
from sim_node.physics.bullet.c_library import c_numbers, captured_output
from sim_node.physics.bullet.urdf_text import write_engine_urdf
from sim_node.physics.settings import WorldSettings

with captured_output("stdout", "stderr"):
    import pybullet

__all__ = ["Engine", "load_urdf", "pybullet"]


class Engine:
    """A private engine without a window, which PyBullet's calls take as their `physicsClientId`.

    PyBullet gives the number of an engine that has ended to the next one. So the number is asked
    for at each call, and a closed engine refuses it. One that nothing refers to is closed.
    """

    _threshold_in_force: ClassVar[float] = WorldSettings.contact_breaking_threshold
    _turns: ClassVar = fork_safe_lock()

    def __init__(
        self, breaking_threshold: float = WorldSettings.contact_breaking_threshold
    ) -> None:
        """Start it; `breaking_threshold` is that of its contacts, m."""
        number = int(pybullet.connect(pybullet.DIRECT))
        self._number: int | None = number
        self._breaking_threshold = breaking_threshold
        self._disconnect = weakref.finalize(self, pybullet.disconnect, number)
        self._disconnect.atexit = False  # the process takes its engines with it

    def __index__(self) -> int:
        """PyBullet's number of it.

        Raises:
            ClosedError: it is closed.
        """
        if self._number is None:
            raise ClosedError("it is closed: its engine has ended; make a new one")
        return self._number

    @contextmanager
    def alone(self) -> Iterator[None]:
        """While no other engine of the process works, and with this one's threshold in force.

        PyBullet has one threshold for the engines of a process. By it the engine looks for what
        may touch, whenever it steps and whenever something is put somewhere; the order in which
        it finds contacts tells of it ever after. Threads take turns; one may enter again.

        Raises:
            ClosedError: it is closed.
        """
        with Engine._turns:
            number = operator.index(self)
            if Engine._threshold_in_force != self._breaking_threshold:
                pybullet.setPhysicsEngineParameter(
                    contactBreakingThreshold=self._breaking_threshold, physicsClientId=number
                )
                Engine._threshold_in_force = self._breaking_threshold
            yield

    def __reduce__(self) -> NoReturn:
        raise SimulationError("an engine, and what is in it, can be neither copied nor pickled")

    def close(self) -> None:
        """End it; a closed one stays so."""
        self._number = None
        self._disconnect()


def load_urdf(client: Engine, loading: UrdfOptions) -> int:
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
    with tempfile.TemporaryDirectory() as directory:
        copy = Path(directory) / "model.urdf"
        copy.write_text(write_engine_urdf(loading, Path(directory)), encoding="utf-8")
        # an engine that caches files would read an old version of a file that was edited
        pybullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)
        with captured_output() as printed, c_numbers():
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
                lines = printed().strip().splitlines()
                reason = f": {lines[-1]}" if lines else ""
                raise CharacterError(f"{loading.urdf_path}: not a usable URDF{reason}") from error
