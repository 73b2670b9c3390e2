"""Many worlds at once for Python: each is a `Simulation` with its `Controller`, to the bit."""

import os
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NoReturn

import numpy as np

from actuated_characters.batch.given import (
    finite_array,
    reference_ticks,
    whole_number,
    world_numbers,
)
from actuated_characters.batch.setup import make_setup
from actuated_characters.metrics.state_hash import StateHash
from controller_node.tracked_reference import TrackedReference
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Character
from msgs_config.errors import (
    ClosedError,
    CommandError,
    ConfigurationError,
    SimulationError,
    one_of,
)
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.plain_values import finite_numbers
from sim_node.physics import batch
from sim_node.physics.batch import ActionKind
from sim_node.physics.engine import make_batch

_NOTHING: Mapping[str, object] = MappingProxyType({})
_ROWS_AHEAD = 512  # ticks of the reference that are sampled beyond those that are needed
_MOST_ROWS = 200_000  # ticks of the reference between worlds: 0.1 GB of a humanoid
_TICKS_AT_ONCE = 256  # after which states are hashed, and the reference is looked at again
_MOST_WORLDS, _MOST_THREADS, _MOST_TICKS = 1_000_000, 1024, 10**9


class Batch:
    """Worlds of engine MuJoCo, one character each, whose ticks are compiled as a whole.

    With the same efforts or actions each has the states of `Simulation` with `Controller`, to the
    bit, whatever the other worlds and the number of threads. Arrays have a row a world.

    Action, one entry (a,) an actuated degree of freedom, as in the environments: `targets`:
    offsets to the tracking errors, rad and m, of a ball joint a rotation vector in the child frame;
    without any the law tracks the reference. `angles`: positions of the joints, as a state has
    them, instead of the reference's. `torques`: efforts, N m and N, without a law.
    """

    def __init__(
        self,
        character: Character,
        count: int,
        *,
        action: str = "targets",
        threads: int = 0,
        watch_contacts: bool = False,
        hash_states: bool = False,
        simulator: Mapping[str, object] = _NOTHING,
        controller: Mapping[str, object] = _NOTHING,
        **reference: object,
    ) -> None:
        """Build the worlds, which begin where the reference does.

        Args:
            character: As `load_character` gives it; joints without damping, friction or mimics.
            count: How many worlds.
            action: What actions mean: `targets`, `angles` or `torques`.
            threads: How many share the work; 0: one a processor.
            watch_contacts: Keep the last tick's contacts.
            hash_states: Keep hashes over all states; the states of a `step` then take memory.
            simulator: Parameters of `sim_node`, by name; the engine is mujoco.
            controller: Parameters of `controller_node`, by name; law stable_pd, no behaviour.
            reference: The same for names without a dot: `clip="walk"`, for instance.

        Raises:
            ActuatedCharactersError: a name or a value is wrong, or a batch cannot do it.
        """
        count = whole_number("count", count, 1, _MOST_WORLDS)
        threads = whole_number("threads", threads, 0, _MOST_THREADS)
        given = make_setup(
            character, action, watch_contacts, simulator, {**controller, **reference}
        )
        setup = given.setup
        self.character = setup.character.character
        self.start = given.motion.first_state()
        """The state in which the reference begins."""
        self.settings = setup.settings
        """What the worlds depend on besides the character."""
        self._clock = TickClock(setup.settings.rate_hz)
        self._motion = TrackedReference(
            self.character, given.motion.reference, self._clock, self._clock.stamp_ns(FIRST_TICK)
        )
        self._follows_velocity = given.follows_velocity
        self._rows = range(0)  # ticks of the reference that the worlds have
        self._samples = np.zeros((0, 2, self.character.layout.size))  # of these ticks
        layout = self.character.layout
        self._actuated = layout.mask(layout.actuated_joint_names)
        self._kind, self._push_ticks = setup.action, given.push_ticks
        processors = len(os.sched_getaffinity(0))
        self._batch: batch.Batch = make_batch(setup, count, threads or processors)
        self._is_closed = False
        self._states = self._batch.states
        self._states.ticks[:] = FIRST_TICK - 1  # which the reset goes on from
        self._first_ticks = np.zeros(count, dtype=np.intp)
        self._hashes = [StateHash() for _ in range(count)] if hash_states else []
        self.reset()

    def __enter__(self) -> "Batch":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __reduce__(self) -> NoReturn:
        raise SimulationError("a Batch can be neither copied nor pickled; make another one")

    def close(self) -> None:
        """End the threads; a closed batch stays closed, and to step it is an error."""
        if not self._is_closed:
            self._is_closed = True
            self._batch.close()

    def __len__(self) -> int:
        return len(self._first_ticks)

    @property
    def motion(self) -> FloatArray:
        """Positions and velocities (count, 2, n) now; what it shows changes with the next step."""
        return _shown(self._states.motion)

    @property
    def position(self) -> FloatArray:
        """Positions (count, n) now, message form; as `motion`."""
        return self.motion[:, 0]

    @property
    def velocity(self) -> FloatArray:
        """Velocities (count, n) now; as `motion`."""
        return self.motion[:, 1]

    @property
    def ticks(self) -> IntArray:
        """How many ticks (count,) have passed since each world's episode began."""
        return self._states.ticks - self._first_ticks

    @property
    def reference_ticks(self) -> IntArray:
        """The ticks (count,) of the reference, from its beginning, at which the worlds are."""
        return self._states.rows.copy()

    @property
    def diverged(self) -> BoolArray:
        """Which worlds (count,) have diverged: they stay in their last sound states until reset."""
        return self._states.failed.copy()

    @property
    def contacts(self) -> FloatArray:
        """Net contact wrenches (count, links, 6) of the last tick: N and N m, world axes.

        What it shows changes with the next step.

        Raises:
            ConfigurationError: the batch does not watch contacts.
        """
        if not len(self._states.contacts):
            raise ConfigurationError("contacts are not watched; make it with watch_contacts=True")
        return _shown(self._states.contacts)

    @property
    def action_size(self) -> int:
        """How many numbers (a,) an action has: the actuated degrees of freedom."""
        return int(np.count_nonzero(self._actuated))

    @property
    def state_hashes(self) -> tuple[str, ...]:
        """Of each world the SHA-256 over all states so far, as `Simulation.state_hash`.

        Raises:
            ConfigurationError: the batch does not hash states.
        """
        if not self._hashes:
            raise ConfigurationError("states are not hashed; make it with hash_states=True")
        return tuple(each.hexdigest() for each in self._hashes)

    def desired(self, ahead: int = 0) -> FloatArray:
        """Positions and velocities (count, 2, n) of the reference, some ticks from now."""
        ahead = whole_number("ahead", ahead, 0, _MOST_TICKS)
        self._sample_ahead(ahead, np.ones(len(self), dtype=np.bool_))
        return self._samples[self._states.rows + ahead - self._rows.start]

    def push(
        self,
        world: int,
        link: str,
        force: Sequence[float] = (0.0, 0.0, 0.0),
        torque: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Push a link of a world from its next tick on, for the parameter `wrench_duration`.

        Args:
            world: Its number.
            link: The link's name.
            force: N, world axes, at the link's centre of mass.
            torque: N m, world axes.

        Raises:
            CommandError: no such link, or force or torque is not three finite numbers.
            ConfigurationError: no such world.
            ClosedError: the batch is closed.
        """
        self._check_open()
        (number,) = world_numbers([world], len(self))
        links = {each.name: row for row, each in enumerate(self.character.links)}
        if link not in links:
            raise CommandError(one_of("link", link, list(links)))
        wrench = [
            finite_numbers(f"the {what} on '{link}'", vector, 3, CommandError)
            for what, vector in (("force", force), ("torque", torque))
        ]
        centre = np.array(self.character.links[links[link]].inertial_pose.position)
        self._batch.push(int(number), links[link], np.concatenate(wrench), centre, self._push_ticks)

    def reset(
        self,
        worlds: Sequence[int] | IntArray | BoolArray | None = None,
        *,
        at: int | Sequence[int] | IntArray = 0,
        position: FloatArray | None = None,
        velocity: FloatArray | None = None,
    ) -> None:
        """Begin a new episode in some worlds, which equals one of a fresh world to the bit.

        Args:
            worlds: Their numbers (k,), or which ones (count,); None: all.
            at: Tick of the reference, one or (k,), that goes with the first state.
            position: Where they begin (k, n), message form; None: where the reference is.
            velocity: The same of velocities (k, n).

        Raises:
            ConfigurationError: no such world or tick, or a state of another shape or not finite.
            ClosedError: the batch is closed.
        """
        self._check_open()
        numbers = world_numbers(worlds, len(self))
        ticks = reference_ticks(at, len(numbers))
        known = {row: self._sample(row) for row in set(ticks)}
        begin = np.array([known[row] for row in ticks]).reshape(-1, 2, self.character.layout.size)
        for place, (what, given) in enumerate((("position", position), ("velocity", velocity))):
            if given is not None:
                begin[:, place] = finite_array(what, given, begin[:, place].shape)
        self._states.ticks[numbers] += 1
        self._states.rows[numbers] = ticks
        self._first_ticks[numbers] = self._states.ticks[numbers]
        self._batch.place(numbers, begin[:, 0], begin[:, 1])

    def step(self, actions: FloatArray | None = None, ticks: int = 1) -> None:
        """Advance all worlds by some ticks, which hold their actions (count, a).

        Without actions the law tracks the reference, or no motor acts with `torques`.

        Raises:
            ConfigurationError: the actions have another shape or are not finite, or are missing.
            ClosedError: the batch is closed.
        """
        self._check_open()
        ticks = whole_number("ticks", ticks, 1, _MOST_TICKS)
        whole: FloatArray | None = None
        if actions is not None:
            whole = np.zeros((len(self), self.character.layout.size))
            whole[:, self._actuated] = finite_array(
                "actions", actions, (len(self), self.action_size)
            )
        elif self._kind is ActionKind.POSITION:
            raise ConfigurationError("a batch of 'angles' needs actions in each step")
        for first in range(0, ticks, _TICKS_AT_ONCE):
            self._advance(min(ticks - first, _TICKS_AT_ONCE), whole)

    def _advance(self, ticks: int, actions: FloatArray | None) -> None:
        """Advance by a few ticks, with actions (count, n), and hash the states."""
        if self._kind is not ActionKind.EFFORT:
            self._sample_ahead(ticks, ~self._states.failed)
        states, before, acting = self._states, self._states.ticks.copy(), ~self._states.failed
        kept = ticks if self._hashes else 0
        history = np.empty((len(self), kept, 2, self.character.layout.size))
        first = states.motion.copy() if self._hashes else states.motion
        self._batch.advance(ticks, actions, history)
        for world, each in enumerate(self._hashes):
            tick, passed = int(before[world]), int(states.ticks[world] - before[world])
            if acting[world] and tick == self._first_ticks[world]:
                each.add_rows(self._stamps(tick, 1), first[world, np.newaxis])
            each.add_rows(self._stamps(tick + 1, passed), history[world, :passed])

    def _stamps(self, first: int, count: int) -> IntArray:
        return np.array([self._clock.stamp_ns(first + k) for k in range(count)], dtype=np.int64)

    def _check_open(self) -> None:
        if self._is_closed:
            raise ClosedError("the batch is closed; make a new one")

    def _sample(self, row: int) -> tuple[FloatArray, FloatArray]:
        """The state of the reference at a tick."""
        _, state = self._motion.own(row)[0]
        return state.configuration.position, state.velocity

    def _sample_ahead(self, ticks: int, worlds: BoolArray) -> None:
        """Have the reference's rows for some worlds (count,), over so many ticks."""
        rows = self._states.rows[worlds]
        if not len(rows):
            return
        first, last = int(rows.min()), int(rows.max()) + ticks
        if first in self._rows and last in self._rows:
            return
        if last - first > _MOST_ROWS:
            raise ConfigurationError(
                f"the worlds are {last - first} ticks of the reference apart; it can be "
                f"{_MOST_ROWS} at most"
            )
        self._rows = range(first, last + _ROWS_AHEAD)
        self._samples = np.array([self._sample(row) for row in self._rows])
        velocities = self._samples[:, 1] * self._follows_velocity
        self._batch.set_reference(first, self._samples[:, 0], velocities)


def _shown(array: FloatArray) -> FloatArray:
    """An array to be read alone."""
    view = array.view()
    view.flags.writeable = False
    return view
