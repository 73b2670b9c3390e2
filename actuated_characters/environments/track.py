"""Tracking a motion as a Gymnasium environment, `actuated_characters/Track-v0`."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

import gymnasium
import numpy as np

from actuated_characters.api import Simulation, SimulationSnapshot
from actuated_characters.environments.actions import (
    TARGETS,
    TORQUES,
    Actuation,
    TargetActuation,
    TorqueActuation,
    check_action,
)
from actuated_characters.environments.assessment import Assessment
from actuated_characters.environments.motion import EpisodeMotion
from actuated_characters.environments.options import (
    RENDER_MODES,
    check_drawing,
    check_options,
    checked_action,
    controller_values,
    start_of,
)
from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.runs.plan import with_shared
from controller_node.model_check import check_inertia
from controller_node.parameters import make_controller_settings
from controller_node.references.factory import make_motion
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.errors import ConfigurationError, SimulationError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Values
from msgs_config.shared_parameters import SharedSettings, collides, placed

if TYPE_CHECKING:
    from actuated_characters.environments.camera import FollowingCamera

_NOTHING: Mapping[str, object] = MappingProxyType({})
_POSES_IN_VIEW, _TIME_IN_VIEW = 16, 4.0  # poses of the reference, s of it, that fit into the view


@dataclass(frozen=True)
class TrackState:
    """All that an environment goes on from; it can be pickled."""

    kind: str  # a hash of the options that must be equal in both environments
    simulation: SimulationSnapshot
    start: float  # s of the reference, where the episode began
    random: Mapping[str, Any]  # the generator's state
    observation: FloatArray  # the last observation
    ticks_down: int  # steps for which it has been down, see `falls`


class TrackEnv(gymnasium.Env[FloatArray, FloatArray]):
    """A character that is to follow a reference by its motors; no force acts on a floating base.

    Action, held for `ticks_per_step` ticks, one entry (a,) an actuated degree of freedom:
    `targets`: offsets to the reference, rad and m, of a ball joint a rotation vector in the child
    frame; the law of `controller_node` acts in each tick, with the character's gains. At zero the
    states are those of `run` without `root_assistance`, to the bit. `angles`: positions of the
    joints, as a state has them, that the same law tracks instead of the reference's. `torques`:
    efforts, N m and N. All may be beyond the bounds of the space; efforts are kept within limits.

    Observation, one array of doubles: of a floating base the height of its origin (m), the
    direction of gravity and the linear velocity (m/s), both in the base frame, and its angular
    velocity; the joints' positions and velocities; the error to the desired state at the next
    step, `reference - state` (n,), and that state's velocity (n,).

    An episode terminates where the centre of mass is more than 0.6 m from the reference's, where it
    fell (`metrics.falls`: it is down for 0.3 s), or where the simulation diverges; it is truncated
    after `duration`.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 30}  # noqa: RUF012 - as in gymnasium

    def __init__(
        self,
        character: str = "humanoid",
        *,
        action: str = TARGETS,
        duration: float = 10.0,
        ticks_per_step: int = 8,
        random_start: bool = False,
        render_mode: str | None = None,
        render_size: Size = (480, 360),
        simulator: Mapping[str, object] = _NOTHING,
        controller: Mapping[str, object] = _NOTHING,
        **reference: object,
    ) -> None:
        """Load the character and its world.

        Args:
            character: Name of one that ships, or path of its YAML or URDF file.
            action: What actions mean: `targets`, `angles` or `torques`.
            duration: Of an episode, s.
            ticks_per_step: How long an action is held; at 240 Hz, 8 are 1/30 s.
            random_start: Begin each episode at a random time, up to `duration`, of the reference.
            render_mode: `rgb_array`: `render` returns a picture, with the reference as a ghost.
            render_size: Width and height of a picture, pixels.
            simulator: Parameters of `sim_node`, by name.
            controller: Parameters of `controller_node`, by name: `{"gains.right_knee.p": 300.0}`.
            reference: The same for names without a dot: `clip="walk"`, for instance.

        Raises:
            ActuatedCharactersError: a name or a value is wrong.
        """
        check_action(action)
        check_options(duration, ticks_per_step, simulator)
        if render_mode is not None:
            check_drawing(render_mode, render_size)
        simulator, given = with_shared(simulator, {**controller, **reference})
        self._character = placed(load_character(character, collides(simulator)), simulator)
        values = controller_values(self._character, given)
        motion = make_motion(self._character, values)
        shared = SharedSettings.of(values)
        clock = TickClock(shared.rate)
        self._motion = EpisodeMotion(motion.reference, clock)
        model = DynamicsModel(self._character, shared.gravity)
        check_inertia(model, self._character)
        self._actuation = self._make_actuation(action, values, model, clock)
        self.action_space = self._actuation.space
        self._simulation = Simulation(
            self._character,  # which is placed already
            motion.first_state(),
            {name: value for name, value in simulator.items() if name != "placement"},
            watch_contacts=False,
        )
        world = self._simulation.settings.world
        self._assessment = Assessment(
            self._character,
            model,
            clock.rate_hz / ticks_per_step,
            world.terrain,
            falls=shared.gravity > 0.0 and (world.ground or world.terrain is not None),
        )
        self.observation_space = gymnasium.spaces.Box(
            -np.inf, np.inf, (self._assessment.size,), dtype=np.float64
        )
        self._duration, self._ticks = float(duration), int(ticks_per_step)
        self._random = random_start
        options = (action, self._ticks, sorted(values.items()))
        self._kind = hashlib.sha256(repr(options).encode()).hexdigest()
        self._is_fresh, self._is_closed = True, False
        self.render_mode, self._render_size = render_mode, render_size
        self.metadata = {**self.metadata, "render_fps": max(clock.rate_hz // self._ticks, 1)}
        self._camera: FollowingCamera | None = None
        self._see()

    def _make_actuation(
        self, action: str, values: Values, model: DynamicsModel, clock: TickClock
    ) -> Actuation:
        if action == TORQUES:
            return TorqueActuation(self._character)
        settings = make_controller_settings(self._character, values)
        return TargetActuation(action, self._character, settings, self._motion, model, clock)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin an episode; `options` may have `start`, the reference's time in s.

        Raises:
            ConfigurationError: the start is no time, or there is another option.
        """
        super().reset(seed=seed)
        start = self._drawn_start() if not options else start_of(options)
        self._motion.begin(start)
        first = self._motion.at(0)
        if not self._is_fresh or start:
            self._simulation.reset(
                StampedState(0, first.configuration.position, first.velocity, None)
            )
        self._is_fresh = False
        self._put_down(0)
        return self._see(), self._info()

    def _put_down(self, ticks_down: int) -> None:
        if self._assessment.fall is not None:
            self._assessment.fall.ticks_down = ticks_down

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Hold an action (a,) for `ticks_per_step` ticks; see the class for what comes back.

        Where the simulation diverges the observation is the one before.

        Raises:
            ConfigurationError: the action has another shape, or is not finite.
        """
        numbers = checked_action(action, self.action_space.shape)
        self._is_fresh = False
        self._actuation.hold(numbers)
        simulation, effort = self._simulation, self._actuation.effort
        try:
            for _ in range(self._ticks):
                simulation.step(effort(simulation.ticks, simulation.state))
        except SimulationError:
            return self._seen.copy(), 0.0, True, False, {**self._info(), "diverged": True}
        reward, is_over = self._assessment.reward(self._present(), self._desired(simulation.ticks))
        is_complete = simulation.ticks >= round(self._duration * simulation.rate_hz)
        return self._see(), reward, is_over, is_complete, self._info()

    def get_state(self) -> TrackState:
        """The state of episode and random numbers, to be given to `set_state`; can be pickled."""
        return TrackState(
            self._kind,
            self._simulation.snapshot(),
            self._motion.start,
            self.np_random.bit_generator.state,
            self._seen,
            0 if self._assessment.fall is None else self._assessment.fall.ticks_down,
        )

    def set_state(self, state: TrackState) -> tuple[FloatArray, dict[str, Any]]:
        """Go on from a state of this environment, or of one with the same options, to the bit.

        Returns observation and information, as `reset` does.

        Raises:
            ConfigurationError: the state is of an environment with other options.
        """
        if not isinstance(state, TrackState) or state.kind != self._kind:
            raise ConfigurationError(
                "the state is not one of an environment with these options: character, action, "
                "ticks_per_step and the parameters must be equal"
            )
        self._simulation.restore(state.simulation)
        self._motion.begin(state.start)
        self.np_random.bit_generator.state = state.random
        self._seen, self._is_fresh = state.observation, False
        self._put_down(state.ticks_down)
        return self._seen.copy(), self._info()

    def render(self) -> Picture | None:
        """A picture (h, w, 3), red, green, blue; None, with a warning, without a render mode.

        Raises:
            CharacterError: a file of the character cannot be drawn.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render has nothing to do: make it with render_mode='rgb_array'")
            return None
        if self._camera is None:
            from actuated_characters.environments.camera import FollowingCamera

            ticks = round(min(self._duration, _TIME_IN_VIEW) * self._simulation.rate_hz)
            shown = np.linspace(0, ticks, _POSES_IN_VIEW).astype(int).tolist()
            self._camera = FollowingCamera(
                self._character,
                self._simulation.settings.world,
                self._render_size,
                [self._motion.at(tick).configuration.position for tick in shown],
            )
        desired = self._motion.at(self._simulation.ticks)
        return self._camera.picture(self._simulation.state.position, desired.configuration.position)

    def close(self) -> None:
        """End the engine; once it is closed, nothing happens."""
        if not self._is_closed:
            self._is_closed = True
            self._simulation.close()

    def __reduce__(self) -> NoReturn:
        raise SimulationError(
            "an environment can be neither copied nor pickled; make another one with the same "
            "options and give it this one's get_state()"
        )

    @property
    def simulation(self) -> Simulation:
        """The world."""
        return self._simulation

    def _drawn_start(self) -> float:
        return float(self.np_random.uniform(0.0, self._duration)) if self._random else 0.0

    def _see(self) -> FloatArray:
        """The observation of the present state, which is kept; a copy of it."""
        ahead = self._desired(self._simulation.ticks + self._ticks)
        self._seen = self._assessment.observation(self._present(), ahead)
        return self._seen.copy()

    def _present(self) -> tuple[FloatArray, FloatArray]:
        state = self._simulation.state
        return state.position, state.velocity

    def _desired(self, tick: int) -> tuple[FloatArray, FloatArray]:
        desired = self._motion.at(tick)
        return desired.configuration.position, desired.velocity

    def _info(self) -> dict[str, Any]:
        """Time in s since the episode began, and of the reference."""
        elapsed = self._simulation.time
        return {"time": elapsed, "reference_time": self._motion.start + elapsed}
