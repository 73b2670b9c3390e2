"""The worlds that a policy is trained in, which differ, and the threads that simulate them."""

from collections.abc import Sequence

import numpy as np

from actuated_characters.training.episode_types import (
    FELL,
    Draws,
    Episode,
    Rules,
    Table,
    Trace,
    World,
)
from actuated_characters.training.episodes import begin, run_decisions
from actuated_characters.training.starts import StartRange, Starts
from controller_node.control_laws import GainArrays
from controller_node.planner.compiled.law import Room
from controller_node.planner.compiled.network import Network
from controller_node.planner.compiled.observation import ObservationScales
from controller_node.planner.compiled.rollout import MOST_BOUNDS, RolloutModel
from controller_node.planner.contact_model import ContactModel
from controller_node.planner.search.cost import ResidualModel
from controller_node.planner.settings import OWN_CONTACTS, WORLD_CONTACTS, PlannerSettings
from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.character.model import Character
from msgs_config.compiled.soft_limits import room_for_bounds
from msgs_config.runtime.worker_threads import WorkerThreads

HOLD_S = 1.0 / 30.0  # s that a decision holds
LARGEST_ACTION = 2.0
_UNIT = 0.5  # sigma of a joint, of an action of one
_KINDS = ((OWN_CONTACTS, 0.35), (WORLD_CONTACTS, 0.45), (OWN_CONTACTS, 0.45), (WORLD_CONTACTS, 0.6))
_STRENGTHS = (0.9, 1.1)  # between which efforts are larger than the law's
_PUSH_SHARE = 0.02  # of decisions, in which a push begins


def hold_ticks(rate_hz: int) -> int:
    """Ticks of a decision."""
    return max(round(HOLD_S * rate_hz), 1)


def action_unit(settings: PlannerSettings) -> FloatArray:
    """The offset (a,) in rad or m of an action of one."""
    return _UNIT * settings.sigma


class TrainingWorlds:
    """Worlds whose contacts, friction and mass differ, in which episodes go on for good."""

    def __init__(
        self,
        character: Character,
        settings: PlannerSettings,
        gains: GainArrays,
        *,
        threads: int,
    ) -> None:
        """Build the models, one a kind of contacts, and for each thread what simulates them."""
        self._settings = settings
        given = settings.parameters
        models = [
            ContactModel(
                character,
                period_s=1.0 / given.rate_hz,
                gravity=given.gravity,
                friction=friction,
                contact=contact,
            )
            for contact, friction in _KINDS
        ]
        self._models = models  # they must outlive what points into them
        self.model, self.body = models[0], models[0].body(gains)
        bodies = [model.body(gains) for model in models]
        kinds = list(zip(models, bodies, strict=True))
        self._threads = WorkerThreads(
            [
                [_world(model, body, character.layout.size) for model, body in kinds]
                for _ in range(threads)
            ]
        )
        self._residuals = ResidualModel(character, self.model, settings)

    def close(self) -> None:
        """End the threads."""
        self._threads.close()

    def begin(
        self,
        table: Table,
        starts: Sequence[StartRange],
        scales: ObservationScales,
        count: int,
        rng: np.random.Generator,
    ) -> None:
        """Begin an episode of some reference in each of so many worlds.

        `rng` is of all that is random from now on.
        """
        self._table, self._rules = table, self._make_rules(scales)
        self._starts = Starts(starts, self._settings.parameters.rate_hz)
        self._rng = rng
        n = table.velocities.shape[1]
        self._episodes = [
            Episode(
                np.zeros(table.positions.shape[1]),
                np.zeros(n),
                np.zeros(2, np.intp),
                np.zeros(5),
                np.zeros(3),
                float(strength),
            )
            for strength in self._rng.uniform(*_STRENGTHS, count)
        ]
        for episode, row in zip(self._episodes, self._starts.draw(count, rng), strict=True):
            begin(episode, int(row), np.zeros(n), table, self.body.joints)

    @property
    def rules(self) -> Rules:
        """What all episodes have in common."""
        return self._rules

    def run(
        self, network: Network, decisions: int, spread: float, most_push: float
    ) -> tuple[Trace, SingleArray]:
        """Let each world go on for so many decisions of a policy.

        Returns the traces (worlds, decisions), and the draws that, times `spread`, were added to
        the actions. Pushes are of up to `most_push`, N s.
        """
        count, rng, n = len(self._episodes), self._rng, self._table.velocities.shape[1]
        trace = self._make_trace(count, decisions)
        shape = (count, decisions)
        noise = rng.standard_normal((*shape, len(self._rules.unit)), np.float32)
        starts = self._starts.draw(count * decisions, rng).reshape(shape)
        off = rng.normal(size=(*shape, n)) * rng.random((*shape, 1))
        pushes = rng.random((*shape, 4))

        def work(worlds: Sequence[World], number: int) -> None:
            draws = Draws(noise[number], starts[number], off[number], pushes[number])
            run_decisions(
                self._episodes[number],
                Trace(*(column[number] for column in trace)),
                network,
                spread,
                draws,
                _PUSH_SHARE if most_push else 0.0,
                most_push,
                self._table,
                self._rules,
                worlds[number % len(worlds)],
            )

        self._threads.share(count, work)
        return trace, noise

    def prefer_hard_starts(self, trace: Trace) -> None:
        """Let more episodes begin around the rows in which those of a trace fell."""
        self._starts.learn(trace.rows, trace.ends == FELL)

    def _make_rules(self, scales: ObservationScales) -> Rules:
        settings, residuals = self._settings, self._residuals
        return Rules(
            hold_ticks(settings.parameters.rate_hz),
            1.0 / settings.parameters.rate_hz,
            action_unit(settings),
            LARGEST_ACTION,
            residuals.weights,
            residuals.loose_weights,
            np.array(residuals.feet, dtype=np.intp),
            np.array(residuals.hands, dtype=np.intp),
            settings.parameters.gives_way,
            scales,
        )

    def _make_trace(self, count: int, decisions: int) -> Trace:
        scales, actions = self._rules.scales, len(self._rules.unit)
        size = len(scales.deviation) + scales.frame_mean.size
        return Trace(
            np.zeros((count, decisions, size), np.float32),
            np.zeros((count, decisions, size), np.float32),
            np.zeros((count, decisions, actions), np.float32),
            np.zeros((count, decisions)),
            np.zeros((count, decisions)),
            np.zeros((count, decisions), np.intp),
            np.zeros((count, decisions), np.intp),
            np.zeros((count, decisions), np.intp),
        )


def _world(model: ContactModel, body: RolloutModel, size: int) -> World:
    engine = model.engine()
    room = Room(np.zeros(size), np.zeros(size), np.zeros(size), engine.law_mass)
    return World(body, engine, room_for_bounds(MOST_BOUNDS, size), room)
