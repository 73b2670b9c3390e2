"""The simulation of characters in one world: efforts for one tick, then the next states. No ROS."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

from msgs_config.arrays import FloatArray
from msgs_config.errors import SimulationError
from msgs_config.tick_clock import FIRST_TICK, TickClock
from sim_node.actor import Actor, Role
from sim_node.pushes import Push
from sim_node.world import World, WorldSettings


@dataclass(frozen=True)
class SimulationSettings:
    """All that a simulation depends on, beside its roles, the efforts and the pushes."""

    rate_hz: int
    substeps: int
    speed_limit: float  # rad/s or m/s
    command_delay_ticks: int
    world: WorldSettings


class Simulation:
    """Forward dynamics in ticks: `(q, v, effort) -> next (q, v)` of every actor.

    The effort is held over the tick and applied anew at each engine step: a force in the world
    stays so, a torque in a body's frame turns with the body.
    """

    def __init__(self, roles: Sequence[Role], settings: SimulationSettings) -> None:
        """Build the world and put the characters into their initial states.

        Raises:
            ConfigurationError: an array or a name in a role does not fit its character.
            LayoutError: a commanded joint does not exist.
            CharacterError: the engine refuses a file.
        """
        self.settings = settings
        self.clock = TickClock(settings.rate_hz)
        self.actors = tuple(
            Actor(role, delay_ticks=settings.command_delay_ticks, step_s=settings.world.step_s)
            for role in roles
        )
        self.tick = FIRST_TICK
        self.episode = 1
        self.watches_contacts = False  # whether to find out what touches, which takes time
        self._world = self._fresh_world()

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the engine."""
        self._world.close()

    @property
    def stamp_ns(self) -> int:
        """The stamp of the present states."""
        return self.clock.stamp_ns(self.tick)

    def step(
        self, efforts: Sequence[FloatArray], pushes: Sequence[Sequence[Push]] | None = None
    ) -> None:
        """Advance one tick: for each actor an effort (n,), clipped to its limits, and its pushes.

        Raises:
            SimulationError: a next state is not finite or faster than the speed limit; it names
                the degree of freedom.
        """
        nothing: list[tuple[Push, ...]] = [()] * len(self.actors)
        for actor, effort, its in zip(self.actors, efforts, pushes or nothing, strict=True):
            actor.begin_tick(effort, its, self.watches_contacts)
        substeps = self.settings.substeps
        for substep in range(substeps):
            for actor in self.actors:
                actor.begin_substep(first=substep == 0)
            self._world.step()
            if self.watches_contacts:
                touched = self._world.touched_links()
                for actor in self.actors:
                    actor.add_contacts(touched, share=1.0 / substeps)
        self.tick += 1
        for actor in self.actors:
            actor.end_tick(self.stamp_ns)
        try:
            for actor in self.actors:
                actor.check_divergence(self.tick, self.settings.speed_limit)
        except SimulationError:
            self.tick -= 1  # nobody is to see that state; a reset's first one has its stamp
            raise

    def reset(self) -> None:
        """Begin a new episode in a new world, whose first states have the next tick's stamp.

        All that follows is what would follow in a fresh simulation, to the bit.
        """
        self.tick += 1
        self.episode += 1
        before, self._world = self._world, self._fresh_world()
        before.close()

    def _fresh_world(self) -> World:
        world = World(self.settings.world)
        try:
            for actor in self.actors:
                actor.enter(world, self.stamp_ns)
        except Exception:
            world.close()
            raise
        return world
