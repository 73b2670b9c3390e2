"""Many environments `actuated_characters/Track-v0` at once, in compiled code: for `make_vec`."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from actuated_characters.batch.worlds import Batch
from actuated_characters.environments.actions import TARGETS, action_space, check_action
from actuated_characters.environments.assessment import Assessment
from actuated_characters.environments.options import (
    UNAIDED_PARAMETERS,
    check_options,
    controller_values,
    start_of,
)
from actuated_characters.runs.plan import choose_reference, with_shared
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.errors import ConfigurationError
from msgs_config.shared_parameters import SharedSettings, collides, placed

_NOTHING: Mapping[str, object] = MappingProxyType({})

Infos = dict[str, Any]


class TrackVectorEnv(VectorEnv[FloatArray, FloatArray, Any]):
    """Environments `TrackEnv` as worlds of a `Batch`: the same actions, observations and rewards.

    The engine is MuJoCo. An episode begins at a whole tick of the reference, the last one up to the
    time that a `TrackEnv` would take; where that is zero, all numbers are those of such an
    environment, to the bit. What has ended begins again in the next step, whose action for it does
    not count.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        character: str = "humanoid",
        *,
        action: str = TARGETS,
        duration: float = 10.0,
        ticks_per_step: int = 8,
        random_start: bool = False,
        threads: int = 0,
        simulator: Mapping[str, object] = _NOTHING,
        controller: Mapping[str, object] = _NOTHING,
        **reference: object,
    ) -> None:
        """Load the character and its worlds.

        Args:
            num_envs: How many.
            character: Name of one that ships, or path of its YAML or URDF file.
            action: What actions mean, as for `TrackEnv`.
            duration: Of an episode, s.
            ticks_per_step: How long an action is held.
            random_start: Begin each episode at a random time, up to `duration`, of the reference.
            threads: How many share the work; 0: one a processor.
            simulator: Parameters of `sim_node`, by name.
            controller: Parameters of `controller_node`, by name.
            reference: The same for names without a dot: `clip="walk"`, for instance.

        Raises:
            ActuatedCharactersError: a name or a value is wrong, or a batch cannot do it.
        """
        check_action(action)
        check_options(duration, ticks_per_step, simulator)
        simulator, given = with_shared(simulator, {**controller, **reference})
        loaded = load_character(character, collides(simulator))
        values = controller_values(placed(loaded, simulator), given)
        ours = {**choose_reference(given), **given, **UNAIDED_PARAMETERS}
        self._batch = Batch(
            loaded, num_envs, action=action, threads=threads, simulator=simulator, controller=ours
        )
        settings, gravity = self._batch.settings, SharedSettings.of(values).gravity
        whole = self._batch.character
        self._assessment = Assessment(
            whole,
            DynamicsModel(whole, gravity),
            settings.rate_hz / ticks_per_step,
            settings.world.terrain,
            falls=gravity > 0.0 and (settings.world.ground or settings.world.terrain is not None),
        )
        self.num_envs, self._ticks = num_envs, int(ticks_per_step)
        self._duration, self._random = float(duration), random_start
        self._last_tick = round(self._duration * settings.rate_hz)
        self._rate_hz = settings.rate_hz
        size = (self._assessment.size,)
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, size, np.float64)
        self.single_action_space = action_space(action, whole)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        self._down = np.zeros(num_envs, dtype=np.intp)  # steps for which each has been down
        self._seen = np.zeros((num_envs, self._assessment.size))
        self._see(np.ones(num_envs, dtype=np.bool_))

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: Infos | None = None
    ) -> tuple[FloatArray, Infos]:
        """Begin all episodes; `options` may have `start`, the reference's time in s.

        Each environment has random numbers of its own: those of `seed`, `seed + 1` and so on.

        Raises:
            ConfigurationError: the start is no time, there is another option, or a list of seeds
                has another length.
        """
        seeds = seed if isinstance(seed, list) else [seed] * self.num_envs
        if len(seeds) != self.num_envs:
            raise ConfigurationError(f"seed has {len(seeds)} entries; it must be {self.num_envs}")
        for number, own in enumerate(seeds):
            if own is not None:
                each = own if isinstance(seed, list) else own + number
                self._generators[number] = seeding.np_random(each)[0]
        everyone = np.ones(self.num_envs, dtype=np.bool_)
        self._begin(everyone, start_of(options) if options else None)
        self._see(everyone)
        return self._seen.copy(), self._infos()

    def step(
        self, actions: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, Infos]:
        """Hold actions (num_envs, a) for `ticks_per_step` ticks.

        Returns observations, rewards, which have terminated, which were truncated, and times.

        Raises:
            ConfigurationError: the actions have another shape, or are not finite.
        """
        begins = self._ended
        self._batch.step(actions, ticks=self._ticks)
        diverged = self._batch.diverged & ~begins
        if begins.any():
            self._begin(begins, None)
        rewards, terminated = self._judge(~begins & ~diverged)
        terminated |= diverged
        truncated = (self._batch.ticks >= self._last_tick) & ~begins & ~diverged
        self._see(~diverged)
        self._ended = terminated | truncated
        infos = self._infos()
        if diverged.any():
            infos |= {"diverged": diverged, "_diverged": diverged}
        return self._seen.copy(), rewards, terminated, truncated, infos

    def close_extras(self, **_: Any) -> None:
        """End the worlds."""
        self._batch.close()

    def _begin(self, which: BoolArray, start: float | None) -> None:
        """Begin episodes at a time of the reference; None: where each is to."""
        worlds = np.flatnonzero(which)
        times = [self._drawn_start(world) if start is None else start for world in worlds.tolist()]
        ticks: IntArray = np.array(
            [int(round(time * self._rate_hz, 6)) for time in times], dtype=np.intp
        )
        self._batch.reset(worlds, at=ticks)
        self._down[worlds] = 0
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)

    def _drawn_start(self, world: int) -> float:
        if not self._random:
            return 0.0
        return float(self._generators[world].uniform(0.0, self._duration))

    def _judge(self, which: BoolArray) -> tuple[FloatArray, BoolArray]:
        """Rewards (num_envs,), and whose motion is lost; of the others zero and False."""
        rewards, lost = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=np.bool_)
        states, desired = self._batch.motion, self._batch.desired()
        fall = self._assessment.fall
        for world in np.flatnonzero(which).tolist():
            if fall is not None:
                fall.ticks_down = int(self._down[world])
            rewards[world], lost[world] = self._assessment.reward(states[world], desired[world])
            if fall is not None:
                self._down[world] = fall.ticks_down
        return rewards, lost

    def _see(self, which: BoolArray) -> None:
        states, ahead = self._batch.motion, self._batch.desired(self._ticks)
        for world in np.flatnonzero(which).tolist():
            self._seen[world] = self._assessment.observation(states[world], ahead[world])

    def _infos(self) -> Infos:
        """Times (num_envs,) in s since the episodes began, and of the reference."""
        there = np.ones(self.num_envs, dtype=np.bool_)
        return {
            "time": self._batch.ticks / self._rate_hz,
            "_time": there,
            "reference_time": self._batch.reference_ticks / self._rate_hz,
            "_reference_time": there,
        }
