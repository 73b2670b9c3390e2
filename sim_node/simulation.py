"""The simulation of one character: apply an effort for one tick, read the next state. No ROS."""

from collections import deque
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character import Character
from msgs_config.errors import ConfigurationError, SimulationError
from msgs_config.stamped import StampedState
from msgs_config.tick_clock import TickClock
from sim_node.world import World, WorldSettings

FIRST_TICK = 1


@dataclass(frozen=True)
class SimulationSettings:
    """All that a simulation depends on, beside the character and the efforts."""

    rate_hz: int
    substeps: int
    gravity: float  # m/s^2, along -z
    friction: float  # of the ground; a contact's is the product of both surfaces'
    link_friction: float
    solver_iterations: int
    speed_limit: float  # rad/s or m/s
    command_delay_ticks: int
    commanded_joints: tuple[str, ...]
    initial_position: tuple[float, ...]  # (n,)
    initial_velocity: tuple[float, ...]  # (n,)


class Simulation:
    """Forward dynamics in ticks: `(q, v, effort) -> next (q, v)`.

    The effort is held over the tick and applied anew at each engine step: a force in the world
    stays so, a torque in a body's frame turns with the body.
    """

    def __init__(self, character: Character, settings: SimulationSettings) -> None:
        """Build the world and put the character into its initial state.

        Raises:
            ConfigurationError: an array or a name in the settings does not fit the character.
            LayoutError: a commanded joint does not exist.
        """
        self.character = character
        self.layout = character.layout
        self.settings = settings
        self.clock = TickClock(settings.rate_hz)
        self.commanded: BoolArray = self.layout.mask(settings.commanded_joints)
        self._limits = character.effort_limits()
        position = self._initial("initial_position", settings.initial_position)
        velocity = self._initial("initial_velocity", settings.initial_velocity)
        self._world = World(
            character,
            WorldSettings(
                step_s=1.0 / (settings.rate_hz * settings.substeps),
                gravity=settings.gravity,
                friction=settings.friction,
                link_friction=settings.link_friction,
                solver_iterations=settings.solver_iterations,
            ),
        )
        self._world.body.set_state(position, velocity)
        zero = np.zeros(self.layout.size)
        self._delayed = deque([zero] * settings.command_delay_ticks)
        self.tick = FIRST_TICK
        self.state = self._read(effort=None)

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

    def step(self, effort: FloatArray) -> StampedState:
        """Advance one tick under an effort (n,), clipped to the character's limits.

        Raises:
            SimulationError: the next state is not finite or faster than the speed limit; it
                names the degree of freedom.
        """
        self._delayed.append(effort + 0.0)  # -0.0 becomes 0.0: a tick has one effort, to the bit
        applied = self.layout.clipped(self._delayed.popleft(), self._limits)
        for _ in range(self.settings.substeps):
            self._world.body.apply(applied)
            self._world.step()
        self.tick += 1
        self.state = self._read(applied)
        self._check_divergence(self.state)
        return self.state

    def _read(self, effort: FloatArray | None) -> StampedState:
        position, velocity = self._world.body.read()
        return StampedState(self.clock.stamp_ns(self.tick), position, velocity, effort)

    def _initial(self, name: str, values: tuple[float, ...]) -> FloatArray:
        if len(values) != self.layout.size:
            raise ConfigurationError(
                f"parameter '{name}' has {len(values)} entries; it must have {self.layout.size}: "
                + ", ".join(self.layout.dof_names)
            )
        return np.array(values)

    def _check_divergence(self, state: StampedState) -> None:
        speed = np.abs(state.velocity)
        sound = (speed <= self.settings.speed_limit) & np.isfinite(state.position)  # NaN is unsound
        if not sound.all():
            worst = int(np.argmin(sound))
            raise SimulationError(
                f"diverged at tick {self.tick}: '{self.layout.dof_names[worst]}' is at "
                f"{state.position[worst]:.4g} with velocity {state.velocity[worst]:.4g}; "
                f"the limit is {self.settings.speed_limit:g}"
            )
