"""Tracking a motion by joint torques as a Gymnasium environment, `actuated_characters/Track-v0`.

The reward is that of DeepMimic (Peng et al. 2018, "DeepMimic", section 5), where the weight of the
end effectors, which it leaves out, goes to the centre of mass:
`0.65 exp(-2 sum |q_d - q|^2) + 0.1 exp(-0.1 sum |v_d - v|^2) + 0.25 exp(-10 |c_d - c|^2)`, the sums
over joints, c the centre of mass, d of the desired state at the new state's time.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from actuated_characters.api import Controller, Simulation
from actuated_characters.metrics.error_measures import is_lost
from actuated_characters.runs.plan import SHARED
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.errors import ConfigurationError, SimulationError
from msgs_config.geometry import rotations
from msgs_config.messages.state import StampedState

_DOWN = np.array((0.0, 0.0, -1.0))
_BASE = 6  # entries of a floating base


class TrackEnv(gymnasium.Env[FloatArray, FloatArray]):
    """A character that is to follow a reference by the efforts of its motors.

    Action: efforts (a,) of the actuated degrees of freedom, N and N m, within their limits, held
    for `ticks_per_step` ticks. There is no force on a floating base.

    Observation, one array of doubles: of a floating base the height of its origin (m), the
    direction of gravity and the linear velocity (m/s), both in the base frame, and its angular
    velocity; the joints' positions and velocities; the error to the desired state at the next
    step, `reference - state` (n,), and that state's velocity (n,).

    An episode terminates where the centre of mass is more than 0.6 m from the reference's, or lower
    than half of it, or the simulation diverges; it is truncated after `duration`.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as the base class declares it

    def __init__(
        self,
        character: str = "humanoid",
        *,
        duration: float = 10.0,
        ticks_per_step: int = 8,
        random_start: bool = False,
        simulator: Mapping[str, object] = MappingProxyType({}),
        **reference: object,
    ) -> None:
        """Load the character and its world.

        Args:
            character: Name of one that ships, or path of its YAML or URDF file.
            duration: Of an episode, s.
            ticks_per_step: How long an action is held; at 240 Hz, 8 are 1/30 s.
            random_start: Begin each episode at a random time, up to `duration`, of the reference.
            simulator: Parameters of `sim_node`, by name.
            reference: `controller_node`'s parameters of the motion: `clip="walk"`, for instance.

        Raises:
            ActuatedCharactersError: a name or a value is wrong.
        """
        _check(duration, ticks_per_step, simulator)
        shared = {name: simulator[name] for name in SHARED if name in simulator}
        controller = Controller(load_character(character), shared, **reference)
        self._character, self._reference = controller.character, controller.reference
        self._layout = self._character.layout
        self._simulation = Simulation(
            self._character, controller.start, simulator, watch_contacts=False
        )
        self._joints = slice(_BASE if self._layout.has_floating_base else 0, None)
        self._model = DynamicsModel(self._character)
        self._actuated = self._layout.mask(self._layout.actuated_joint_names)
        self._duration, self._ticks, self._random = duration, ticks_per_step, random_start
        self._start = 0.0  # s of the reference, where the episode began
        self._is_fresh = True
        self._make_spaces()

    def _make_spaces(self) -> None:
        limits = np.repeat(self._character.effort_limits(), self._layout.vector_lengths)
        bound = limits[self._actuated]
        self.action_space = spaces.Box(-bound, bound, dtype=np.float64)
        size = len(self._observe())
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), dtype=np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin an episode; `options` may have `start`, the reference's time in s."""
        super().reset(seed=seed)
        self._start = float((options or {}).get("start", self._drawn_start()))
        if not 0.0 <= self._start < math.inf:
            raise ConfigurationError(f"start is {self._start} s; it must be 0 or later")
        first = self._reference.sample(self._start)
        start = StampedState(0, first.configuration.position, first.velocity, None)
        if not self._is_fresh or self._start:
            self._simulation.reset(start)
        self._is_fresh = False
        return self._observe(), self._info()

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Hold an action (a,) for `ticks_per_step` ticks; see the class for what comes back.

        Where the simulation diverges the observation is the one before.

        Raises:
            ConfigurationError: the action has another shape, or is not finite.
        """
        shape = self.action_space.shape
        if np.shape(action) != shape or not np.isfinite(action).all():
            raise ConfigurationError(f"an action must have shape {shape} and finite numbers")
        effort = np.zeros(self._layout.size)
        effort[self._actuated] = action
        self._is_fresh = False
        try:
            for _ in range(self._ticks):
                self._simulation.step(effort)
        except SimulationError:
            return self._seen, 0.0, True, False, {**self._info(), "diverged": True}
        reward, is_over = self._judge()
        is_complete = self._simulation.ticks >= round(self._duration * self._simulation.rate_hz)
        return self._observe(), reward, is_over, is_complete, self._info()

    def close(self) -> None:
        """End the engine."""
        self._simulation.close()

    @property
    def simulation(self) -> Simulation:
        """The world."""
        return self._simulation

    def _drawn_start(self) -> float:
        return float(self.np_random.uniform(0.0, self._duration)) if self._random else 0.0

    def _desired(self, ahead: int = 0) -> ReferenceState:
        ticks = self._simulation.ticks + ahead
        return self._reference.sample(self._start + ticks / self._simulation.rate_hz)

    def _observe(self) -> FloatArray:
        state, desired = self._simulation.state, self._desired(self._ticks)
        layout, base = self._layout, np.zeros(0)
        here = layout.configuration(state.position)
        if layout.has_floating_base:
            back = rotations.conjugate(here.orientations_xyzw[0])
            turned = [rotations.rotate(back, vector) for vector in (_DOWN, state.velocity[:3])]
            base = np.concatenate((state.position[2:3], *turned, state.velocity[3:_BASE]))
        difference = layout.difference(here, desired.configuration)
        own = (base, state.position[self._joints], state.velocity[self._joints])
        self._seen = np.concatenate((*own, difference, desired.velocity))
        return self._seen.copy()

    def _judge(self) -> tuple[float, bool]:
        """The reward of the present state, and whether the motion is lost."""
        layout, joints = self._layout, self._joints
        state, desired = self._simulation.state, self._desired()
        turn = layout.difference(layout.configuration(state.position), desired.configuration)
        pose = float(np.sum(turn[joints] ** 2))
        speed = float(np.sum((desired.velocity - state.velocity)[joints] ** 2))
        centre = self._model.centre_of_mass_at(state.position)
        wanted = self._model.centre_of_mass_at(desired.configuration.position)
        away = float(np.sum((wanted - centre) ** 2))
        reward = 0.65 * np.exp(-2.0 * pose) + 0.1 * np.exp(-0.1 * speed) + 0.25 * np.exp(-10 * away)
        return float(reward), layout.has_floating_base and is_lost(centre, wanted)

    def _info(self) -> dict[str, Any]:
        """Time in s since the episode began, and of the reference."""
        elapsed = self._simulation.time
        return {"time": elapsed, "reference_time": self._start + elapsed}


def _check(duration: float, ticks_per_step: int, simulator: Mapping[str, object]) -> None:
    """Raise ConfigurationError if an option is wrong."""
    if not isinstance(ticks_per_step, int) or ticks_per_step < 1:
        raise ConfigurationError(f"ticks_per_step is {ticks_per_step}; it must be 1 or more")
    if not 0.0 < duration < math.inf:
        raise ConfigurationError(f"duration is {duration} s; it must be a time above 0")
    for name in ("initial_position", "initial_velocity", "initial_state"):
        if name in simulator:
            raise ConfigurationError(f"'{name}' is where the reference begins; leave it out")
