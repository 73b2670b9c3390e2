"""Many worlds of one character each in MuJoCo, simulated by threads in compiled code."""

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.compiled.dynamics import convert_rows
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.worker_threads import WorkerThreads
from sim_node.physics.batch import ActionKind, BatchSetup, BatchStates
from sim_node.physics.joint_resistance import JointResistance
from sim_node.physics.mujoco.compiled_batch import (
    BatchModel,
    Commands,
    Worker,
    Worlds,
    advance,
    place,
)
from sim_node.physics.mujoco.compiled_step import Pushes, step_buffers
from sim_node.physics.mujoco.world import MujocoWorld
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.physics.soft_limits import limits_and_room

_SHARES = 2  # parts a thread takes of the worlds, so that a late one does not hold up all
_LEAST_SHARE = 8  # worlds, below which a part would cost more than it brings


class MujocoBatch:
    """Worlds that share the model; a thread has its own memory, which simulates one by one."""

    def __init__(self, setup: BatchSetup, count: int, threads: int) -> None:
        """Make worlds, whose first states are to be placed.

        Raises:
            ConfigurationError: the character's joints are not of those that are simulated here.
            CharacterError: MuJoCo refuses the character or the terrain.
        """
        settings, character = setup.settings, setup.character.character
        if JointResistance(character, settings.world.step_s).active:
            raise ConfigurationError(
                f"a batch has no joints with damping, friction or mimics, as {character.file.name} "
                "has; take a Simulation for each"
            )
        if setup.character.mass_factors:
            raise ConfigurationError(
                "parameter 'mass_factors': a batch has none; take a Simulation for each"
            )
        one = SimulatedCharacter(
            setup.character,
            delay_ticks=settings.command_delay_ticks,
            step_s=settings.world.step_s,
            substeps=settings.substeps,
            speed_limit=settings.speed_limit,
        )
        self._speed_bound = one.speed_bounds[settings.world.ground]
        self._world = MujocoWorld(settings.world)
        body = self._world.add(character, self._speed_bound)
        self._limits, _ = limits_and_room(character)
        self._setup, self._held = setup, list[object]()  # what compiled code knows by addresses
        self._model = BatchModel(
            setup.law,
            setup.driven & one.commanded,
            character.effort_limits().astype(float),
            settings.substeps,
            settings.world.step_s,
            settings.speed_limit,
            self._limits,
            body.places,
            7 * character.layout.has_floating_base,
        )
        size, positions = character.layout.size, self._world.model.nq
        self.states = BatchStates(
            np.zeros((count, 2, size)),
            np.zeros(count, dtype=np.intp),
            np.zeros(count, dtype=np.intp),
            np.zeros(count, dtype=np.bool_),
            np.zeros((count * setup.watches_contacts, len(character.links), 6)),
        )
        self._positions = np.zeros((count, positions))
        self._delayed = np.zeros((count, settings.command_delay_ticks, size))
        self._first_row = 0
        self._targets, self._velocities = np.zeros((0, positions)), np.zeros((0, size))
        self._pushes: list[tuple[int, int, FloatArray, FloatArray, int, int]] = []
        self._workers = [self._worker() for _ in range(min(threads, count))]
        self._threads = WorkerThreads(self._workers)

    def _worker(self) -> Worker:
        settings, character = self._setup.settings, self._setup.character.character
        model, data = self._world.model, mujoco.MjData(self._world.model)
        dynamics = DynamicsModel(character, settings.world.gravity)
        self._held += [model, data, dynamics]
        self._view = dynamics.view
        _, bounds = limits_and_room(character)
        size = character.layout.size
        buffers = step_buffers(model, data, self._speed_bound, settings.world.step_s)
        rooms = (np.zeros((2, size)), *(np.zeros(size) for _ in range(5)))
        return Worker(buffers, dynamics.parts, bounds, *rooms)

    def place(self, worlds: IntArray, position: FloatArray, velocity: FloatArray) -> None:
        """See `Batch.place`."""
        begun, everything = self._converted(position), self._worlds(self._no_history)
        place(worlds, begun, np.array(velocity, dtype=float), everything, self._model)
        placed = set(worlds.tolist())
        self._pushes = [push for push in self._pushes if push[0] not in placed]

    def set_reference(self, first: int, position: FloatArray, velocity: FloatArray) -> None:
        """See `Batch.set_reference`."""
        self._first_row = first
        self._targets = self._converted(position)
        self._velocities = np.array(velocity, dtype=float)

    def push(
        self, world: int, link: int, wrench: FloatArray, point: FloatArray, ticks: int
    ) -> None:
        """See `Batch.push`."""
        first = int(self.states.ticks[world])
        self._pushes.append((world, link + 1, wrench, point, first, first + ticks))

    def advance(self, ticks: int, actions: FloatArray | None, history: FloatArray) -> None:
        """See `Batch.advance`."""
        worlds, commands = self._worlds(history), self._commands(actions)
        count, workers = len(self._positions), len(self._workers)
        shares = min(workers, count) if workers > 1 else 1
        if count >= _SHARES * _LEAST_SHARE * workers > _SHARES * _LEAST_SHARE:
            shares = _SHARES * workers
        ends = [share * count // shares for share in range(shares + 1)]

        def work(worker: Worker, number: int) -> None:
            first, last = ends[number], ends[number + 1]
            advance(first, last, ticks, worlds, commands, self._model, worker)

        self._threads.share(shares, work)

    def close(self) -> None:
        """See `Batch.close`."""
        self._threads.close()

    @property
    def _no_history(self) -> FloatArray:
        count, _, size = self.states.motion.shape
        return np.zeros((count, 0, 2, size))

    def _worlds(self, history: FloatArray) -> Worlds:
        states = self.states
        return Worlds(
            self._positions,
            states.motion,
            states.ticks,
            states.rows,
            self._delayed,
            states.failed,
            states.contacts,
            history,
        )

    def _commands(self, actions: FloatArray | None) -> Commands:
        size, kind = self.states.motion.shape[2], self._setup.action
        given = np.zeros((0, size)) if actions is None else np.array(actions, dtype=float)
        aims = given if kind is ActionKind.POSITION else given[:0]
        return Commands(
            int(kind),
            given,
            self._converted(aims),
            self._first_row,
            self._targets,
            self._velocities,
            self._acting(),
        )

    def _acting(self) -> Pushes:
        """The pushes that act or wait; forgets those that are over."""
        ticks = self.states.ticks.tolist()
        self._pushes = sorted(
            (push for push in self._pushes if ticks[push[0]] < push[5]), key=lambda push: push[0]
        )
        rows = self._pushes
        whose = np.array([push[0] for push in rows], dtype=np.intp)
        return Pushes(
            np.searchsorted(whose, np.arange(len(ticks) + 1)).astype(np.intp),
            np.array([push[1] for push in rows], dtype=np.intp),
            np.array([push[2] for push in rows], dtype=float).reshape(-1, 6),
            np.array([push[3] for push in rows], dtype=float).reshape(-1, 3),
            np.array([push[4] for push in rows], dtype=np.intp),
            np.array([push[5] for push in rows], dtype=np.intp),
        )

    def _converted(self, positions: FloatArray) -> FloatArray:
        """Positions (k, n), message form, as MuJoCo has them (k, q)."""
        return convert_rows(self._view, np.array(positions, dtype=float))
