"""The simulation of characters in one world: efforts for one tick, then the next states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from msgs_config.arrays import FloatArray
from msgs_config.errors import ClosedError, SimulationError
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.messages.state import StampedState
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.engine import World, make_world
from sim_node.physics.pins import Pin
from sim_node.physics.settings import SimulationSettings, WorldSettings
from sim_node.physics.simulated_character import (
    CharacterSetup,
    CharacterSnapshot,
    SimulatedCharacter,
)
from sim_node.physics.wrenches import ExternalWrench


@dataclass(frozen=True)
class Snapshot:
    """A state between two ticks, for any simulation of equal setups."""

    settings: SimulationSettings  # the episode's
    tick: int
    episode: int
    characters: tuple[CharacterSnapshot, ...]
    throws: tuple[ProjectileThrow, ...]  # those of the last tick
    balls: tuple[ProjectileThrow, ...]  # those that are in the world
    thrown_at: tuple[int, ...]  # the tick at which each ball was thrown
    world: bytes  # the engine's state


class Simulation:
    """Forward dynamics in ticks: `(q, v, effort) -> next (q, v)` of every character.

    The effort is held over the tick and applied again at each engine step: a force in the world
    stays so, a torque in a body's frame turns with the body.
    """

    def __init__(
        self,
        setups: Sequence[CharacterSetup],
        settings: SimulationSettings,
        first_tick: int = FIRST_TICK,
    ) -> None:
        """Build the world and put the characters into their initial states, which are `first_tick`.

        Raises:
            ConfigurationError: an array or a name in a setup does not fit its character.
            LayoutError: a commanded joint does not exist.
            CharacterError: the engine refuses a file.
        """
        self.settings = settings
        self.clock = TickClock(settings.rate_hz)
        self.characters = tuple(
            SimulatedCharacter(
                setup,
                delay_ticks=settings.command_delay_ticks,
                step_s=settings.world.step_s,
                substeps=settings.substeps,
                speed_limit=settings.speed_limit,
            )
            for setup in setups
        )
        self.tick = first_tick
        self.episode = 1
        # Finding out what touches takes time: it is done in each of several substeps, and after a
        # single one only if it is read.
        self.watches_contacts = False
        self.throws: tuple[ProjectileThrow, ...] = ()  # those at the beginning of the last tick
        self._thrown_at: tuple[int, ...] = ()
        self._is_closed = False
        self._world = self._fresh_world()

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the engine; what the last tick has led to can be read after that.

        A closed simulation stays closed.
        """
        if self._is_closed:
            return
        self._is_closed = True
        self._end_world()

    def _end_world(self) -> None:
        """End the engine, after what the last tick has led to was found in it."""
        try:
            for character in self.characters:
                character.find_contacts()
        finally:
            self._world.close()

    def check_open(self) -> None:
        """Raise ClosedError if it is closed."""
        if self._is_closed:
            raise ClosedError("the simulation is closed; make a new one")

    @property
    def stamp_ns(self) -> int:
        """The stamp of the present states."""
        return self.clock.stamp_ns(self.tick)

    @property
    def balls(self) -> tuple[ProjectileThrow, ...]:
        """What was thrown in this episode, and is still in the world."""
        return self._world.balls.throws

    def ball_motion(self) -> FloatArray:
        """Centre m, orientation xyzw, velocity m/s and rad/s of each ball, world: (m, 13)."""
        return self._world.balls.motion()

    def step(
        self,
        efforts: Sequence[FloatArray],
        pushes: Sequence[Sequence[ExternalWrench]] | None = None,
        throws: Sequence[ProjectileThrow] = (),
        pins: Sequence[Sequence[Pin]] | None = None,
    ) -> None:
        """Advance one tick: each character's effort (n,), clipped to its limits, and its pushes.

        Throws are let go first. Of each character, `pins` are those that are others from this tick
        on: they hold until they are changed again, or the episode ends.

        Raises:
            SimulationError: a next state is not finite or faster than the speed limit; it names
                the degree of freedom.
            ClosedError: the simulation is closed.
        """
        self.check_open()
        nothing: Sequence[Sequence[Any]] = [()] * len(self.characters)
        given = zip(self.characters, efforts, pushes or nothing, pins or nothing, strict=True)
        for character, effort, own, changes in given:
            character.change_pins(changes)
            character.begin_tick(effort, own, self.watches_contacts)
        self._move_balls(throws)
        substeps = self.settings.substeps
        for substep in range(substeps):
            for character in self.characters:
                character.begin_substep(first=substep == 0)
            self._world.step()
            if self.watches_contacts:
                for character in self.characters:
                    character.add_contacts(share=1.0 / substeps)
            for character in self.characters:
                character.end_substep()
        self.tick += 1
        for character in self.characters:
            character.end_tick(self.stamp_ns)
        try:
            for character in self.characters:
                character.check_divergence(self.tick)
        except SimulationError:
            self.tick -= 1  # it is not published: the first after a reset has its stamp
            raise

    def _move_balls(self, throws: Sequence[ProjectileThrow]) -> None:
        """Let balls go, and take those out of the way whose time is over."""
        if self.settings.ball_ticks:
            over = self.tick - self.settings.ball_ticks
            for number, thrown_at in enumerate(self._thrown_at):
                if thrown_at == over:
                    self._world.balls.put_away(number)
        self.throws = tuple(throws)
        for throw in throws:
            self._world.balls.add(throw)
        self._thrown_at += (self.tick,) * len(throws)

    def reset(
        self,
        world: WorldSettings | None = None,
        states: Mapping[str, StampedState] = MappingProxyType({}),
    ) -> None:
        """Begin a new episode in a new world, whose first states have the next tick's stamp.

        All that follows is what would follow in a fresh simulation, to the bit. This and all later
        episodes are in a world of other settings, and begin in other states, by the characters'
        names, where they are given; the engine's step stays.

        Raises:
            ClosedError: the simulation is closed.
        """
        self.check_open()
        if world is not None:
            assert world.step_s == self.settings.world.step_s
            self.settings = replace(self.settings, world=world)
        self.tick += 1
        self.episode += 1
        self.throws, self._thrown_at = (), ()
        self.begin_in(states)

    def begin_in(self, states: Mapping[str, StampedState]) -> None:
        """Begin this and all later episodes in other states, by the characters' names.

        To be called before the first step.

        Raises:
            ClosedError: the simulation is closed.
        """
        self.check_open()
        for character in self.characters:
            if (state := states.get(character.setup.name)) is not None:
                character.begin_in(state.position, state.velocity)
        self._end_world()  # first: two engines at a time would take twice the memory
        self._world = self._fresh_world()

    def snapshot(self) -> Snapshot:
        """The present state, for this simulation or one in another process.

        Raises:
            ClosedError: the simulation is closed.
        """
        self.check_open()
        return Snapshot(
            self.settings,
            self.tick,
            self.episode,
            tuple(character.snapshot() for character in self.characters),
            self.throws,
            self.balls,
            self._thrown_at,
            self._world.to_bytes(),
        )

    def load_snapshot(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot: what follows is what followed it, to the bit.

        Raises:
            ClosedError: the simulation is closed.
        """
        self.check_open()
        each = list(zip(self.characters, snapshot.characters, strict=True))
        # in a world without a step yet the engine has not found out what touches: only a fresh one
        # is like that
        is_first = all(its.before is None for _, its in each)
        # balls of the engine that are made anew would not be known again by what touched them
        others = snapshot.balls[: len(self.balls)] != self.balls
        if is_first or others or snapshot.settings != self.settings:
            self.settings = snapshot.settings
            for character, its in each:
                character.begin_in(*its.start)
            self._end_world()
            self._world = self._fresh_world()
        if not is_first:
            self._world.from_bytes(snapshot.world, snapshot.balls)
        self.tick, self.episode = snapshot.tick, snapshot.episode
        self.throws, self._thrown_at = snapshot.throws, snapshot.thrown_at
        for character, its in each:
            character.restore(its)

    def _fresh_world(self) -> World:
        world = make_world(self.settings.world)
        try:
            ground, gravity = self.settings.world.ground, self.settings.world.gravity
            bodies = [
                world.add(each.character, each.speed_bounds[ground]) for each in self.characters
            ]
            for character, body in zip(self.characters, bodies, strict=True):
                character.enter(body, world.balls, gravity, self.stamp_ns)
        except Exception:
            world.close()
            raise
        return world
