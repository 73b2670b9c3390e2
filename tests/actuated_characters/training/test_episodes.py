"""Episodes are what the product does: its law, its observations, its anchor, its costs."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.training import episodes as compiled
from actuated_characters.training.episode_types import CUT, FELL, Table, Trace
from actuated_characters.training.references import TrainedReference, make_scales, make_table
from actuated_characters.training.rewards import cost_of
from actuated_characters.training.starts import StartRange
from actuated_characters.training.worlds import TrainingWorlds
from controller_node.planner.anchor import Anchor
from controller_node.planner.base import TickState
from controller_node.planner.compiled.network import Network
from controller_node.planner.compiled.rollout import Desired
from controller_node.planner.policy import planner as product
from controller_node.planner.policy.choosing import Policies
from controller_node.planner.policy.file import Policy
from controller_node.planner.policy.planner import PolicyPlanner
from controller_node.planner.search.cost import ResidualModel
from controller_node.planner.search.rollout_pool import RolloutPool
from controller_node.references.offsets import Offsets
from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from tests.support.training import HUMANOID, walking_job

JOB = walking_job()
RATE = JOB.settings.parameters.rate_hz
CLOCK = TickClock(RATE)
N = HUMANOID.layout.size
STANDING_MASS = HUMANOID.mass


class Stage:
    """One world in which episodes of the walk begin at its first row, undisturbed."""

    def __init__(self) -> None:
        self.worlds = TrainingWorlds(HUMANOID, JOB.settings, JOB.gains, threads=1)
        self.table, _ = make_table(self.worlds.model, self.worlds.body, JOB.references, RATE)
        begins = [StartRange(0, RATE, wraps=True)]
        self.scales = make_scales(self.table, begins, self.worlds.model.feature_layout)
        self.begin(self.table)

    def begin(self, table: Table, row: int = 0) -> None:
        """Begin an episode at a row, in the state of the reference."""
        begins = [StartRange(row, 1, wraps=False)]
        self.worlds.begin(table, begins, self.scales, 1, np.random.default_rng(3))
        (episode,) = self.worlds._episodes
        self.episode = episode._replace(strength=1.0)
        self.worlds._episodes = [self.episode]
        compiled.begin(self.episode, row, np.zeros(N), table, self.worlds.body.joints)

    def network(self, seed: int | None = None) -> Network:
        """A network that answers with zeros, or with what a seed says."""
        inputs = len(self.scales.deviation) + self.scales.frame_mean.size
        sizes = [(inputs, 8), (8, 8), (8, N - 6)]
        rng = np.random.default_rng(seed)
        arrays: list[SingleArray] = []
        for size in sizes:
            scale = 0.0 if seed is None else 1.0 / math.sqrt(size[0])
            arrays.append((scale * rng.normal(size=size)).astype(np.float32))
            arrays.append(np.zeros(size[1], np.float32))
        return Network(*arrays)

    def go_on(self, decisions: int, network: Network | None = None) -> Trace:
        """What happens in so many decisions without noise and pushes."""
        trace, _ = self.worlds.run(network or self.network(), decisions, 0.0, 0.0)
        return Trace(*(column[0] for column in trace))

    def anchor(self) -> Anchor:
        """Where the reference's world is."""
        place, yaw = complex(*self.episode.anchor[:2]), float(self.episode.anchor[2])
        return Anchor(place, yaw, *map(float, self.episode.anchor[3:]))

    def true_state(self) -> tuple[FloatArray, FloatArray]:
        """The state in the world, MuJoCo's: that of the reference's moved back."""
        there = self.anchor()
        turned = Anchor(yaw=-there.yaw)
        position, velocity = turned.to_reference_world(
            self.episode.position.copy(), self.episode.velocity.copy()
        )
        position[0] += there.place.real
        position[1] += there.place.imag
        return position, velocity


@pytest.fixture(scope="module")
def opened() -> Iterator[Stage]:
    stage = Stage()
    yield stage
    stage.worlds.close()


@pytest.fixture
def stage(opened: Stage) -> Stage:
    opened.begin(opened.table)
    return opened


@pytest.mark.parametrize("gives_way", [False, True])
def test_a_decision_costs_what_the_planners_residuals_are(stage: Stage, gives_way: bool) -> None:
    residuals = ResidualModel(HUMANOID, stage.worlds.model, JOB.settings)
    draws = np.random.default_rng(4)

    for _ in range(20):
        deviation = draws.normal(size=stage.worlds.model.feature_count)
        each = residuals.residuals(deviation, perturbed=gives_way)
        expected = JOB.settings.checks * float(each @ each)
        assert cost_of(deviation, gives_way, stage.worlds.rules) == pytest.approx(
            expected, rel=1e-9
        )


def test_costs_are_the_same_whichever_way_the_reference_faces(stage: Stage) -> None:
    centre, angle = stage.scales.centre, 0.7
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    deviation = np.random.default_rng(5).normal(size=stage.worlds.model.feature_count)
    turned = deviation.copy()
    for first in range(centre, len(deviation), 3):
        turned[first : first + 2] = turn @ deviation[first : first + 2]

    for gives_way in (False, True):
        here, there = (cost_of(each, gives_way, stage.worlds.rules) for each in (deviation, turned))
        assert here == pytest.approx(there, rel=1e-9)


def test_without_answers_a_world_is_the_planners_without_a_plan(stage: Stage) -> None:
    table, decisions = stage.table, 6
    ticks = decisions * stage.worlds.rules.hold
    desired = Desired(
        0, 1, ticks, 0, 1, table.positions[: ticks + 1], table.velocities[: ticks + 1]
    )
    offsets = Offsets(ticks, 0, np.zeros((2, N - 6)))
    pool = RolloutPool(stage.worlds.model, 1)

    trace = stage.go_on(decisions)

    position, velocity = pool.state_after(
        table.positions[0], table.velocities[0], offsets, desired, stage.worlds.body
    )
    assert not trace.ends.any()
    np.testing.assert_allclose(stage.episode.position, position, atol=1e-12)
    np.testing.assert_allclose(stage.episode.velocity, velocity, atol=1e-10)
    assert np.abs(position - table.positions[ticks]).max() > 1e-3  # else it would say little


def test_a_push_gives_the_momentum_that_is_drawn(stage: Stage) -> None:
    period, hold = 1.0 / RATE, stage.worlds.rules.hold
    for draw in np.random.default_rng(6).random((20, 3)):
        stage.episode.push[:] = 0.0
        compiled._draw_push(stage.episode, np.array([0.0, *draw]), 0.5, 30.0, period)
        x, y, ticks = stage.episode.push

        impulse = 30.0 * draw[1]
        along = (math.cos(2 * math.pi * draw[0]), math.sin(2 * math.pi * draw[0]))
        np.testing.assert_allclose(
            np.array((x, y)) * ticks * period, impulse * np.array(along), rtol=1e-12
        )
        assert 0.1 <= ticks * period < 0.2 + period
    compiled._draw_push(stage.episode, np.array([0.0, 0.5, 0.0, 0.5]), 0.5, 30.0, period)
    assert (x, y, ticks) == tuple(stage.episode.push), "a push lasts until it is over"

    # in the air nothing else changes the momentum
    momenta, high = [], stage.table.positions.copy()
    high[:, 2] += 2.0
    features = stage.table.features.copy()
    features[:, stage.scales.centre + 2] += 2.0
    table = stage.table._replace(positions=high, features=features)
    for pushed in (False, True):
        stage.begin(table)
        if pushed:
            stage.episode.push[:] = 100.0, -60.0, hold + 5.0
        assert not stage.go_on(2).ends.any()
        pool = RolloutPool(stage.worlds.model, 1)
        features = pool.features_of(
            stage.episode.position, stage.episode.velocity, stage.worlds.body
        )
        first = stage.scales.centre + 3
        momenta.append(STANDING_MASS * features[first : first + 2])
        assert stage.episode.push[2] == 0.0
    lasted = (hold + 5.0) * period
    gained = momenta[1] - momenta[0]
    np.testing.assert_allclose(gained, (100.0 * lasted, -60.0 * lasted), rtol=2e-3)


def test_training_and_product_see_the_same_and_give_way_alike(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[SingleArray] = []
    decide = product.decide

    def note(*given: object) -> float:
        seen.append(given[3].copy())  # type: ignore[attr-defined]
        return decide(*given)  # type: ignore[arg-type]

    rules, network = stage.worlds.rules, stage.network(7)
    value = Network(*network[:4], network.weights_3[:, :1].copy(), network.bias_3[:1].copy())
    about = {"hold": rules.hold, "rate": RATE, "largest": rules.largest}
    gains = JOB.gains.stiffness, JOB.gains.damping
    policy = Policy(about, network, value, stage.scales, stage.table.ahead, rules.unit, *gains)
    player = PolicyPlanner(HUMANOID, Policies(policy), JOB.settings.parameters)
    monkeypatch.setattr(product, "decide", note)  # it has decided once, to be compiled
    (reference,) = JOB.references
    told, moved = [], 0.0

    for number in range(24):
        position, velocity = stage.true_state()
        tick, model = number * rules.hold, stage.worlds.model
        assert stage.episode.counts.tolist() == [tick, number]
        state = StampedState(CLOCK.stamp_ns(tick), model.message_position(position), velocity, None)
        at = TickState(tick, state)
        offset = player.offset(at, at, JOB.gains, reference.reference.desired_at)
        if number == 3:  # 60 N s
            stage.episode.push[:] = 200.0, 400.0, round(0.134 * RATE)
        before = stage.anchor()
        if number:
            np.testing.assert_allclose(
                (player.anchor.place, player.anchor.yaw), (before.place, before.yaw), atol=1e-6
            )
            assert player.anchor.is_perturbed(tick / RATE) == before.is_perturbed(tick / RATE)
        trace = stage.go_on(1, network)
        told.append(trace.observations[0])
        answer = rules.unit * np.clip(trace.actions[0], -rules.largest, rules.largest)
        np.testing.assert_allclose(offset[6:], answer, atol=1e-4)
        moved = max(moved, abs(before.place))
        if trace.ends[0]:
            break

    np.testing.assert_allclose(np.array(told), np.array(seen), atol=2e-4)
    assert len(told) > 8
    assert moved > 0.05, "the push was too weak to say anything of the anchor"


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_the_world_takes_no_notice_of_where_the_reference_goes(stage: Stage, yaw: float) -> None:
    """The state in the world is the same whether the reference gives way or not."""
    rules, states, anchors = stage.worlds.rules, [], []

    for gives_way in (False, True):
        stage.begin(stage.table)
        stage.worlds._rules = rules._replace(gives_way=gives_way)
        stage.episode.anchor[:] = 0.4, -0.2, yaw, 5.0, 0.0
        position, velocity = Anchor(yaw=0.3).to_reference_world(
            stage.table.positions[0], stage.table.velocities[0]
        )
        stage.episode.position[:], stage.episode.velocity[:] = position, velocity
        assert not stage.go_on(1).ends.any()
        states.append(np.concatenate(stage.true_state()))
        anchors.append(stage.episode.anchor.copy())
    stage.worlds._rules = rules

    assert np.abs(anchors[1] - anchors[0])[:3].min() > 1e-4
    np.testing.assert_allclose(states[1], states[0], atol=1e-9)


def test_an_episode_that_falls_ends_and_another_one_begins(stage: Stage) -> None:
    stage.episode.position[2] -= 0.4  # the centre of mass is out of bounds at once

    trace = stage.go_on(1)

    assert trace.ends.tolist() == [FELL]
    assert trace.lengths.tolist() == [1]
    assert trace.rewards.tolist() == [0.0]
    assert stage.episode.counts.tolist() == [0, 0]
    off = np.abs(stage.episode.position - stage.table.positions[0])
    assert off[:7].max() < 1e-9
    assert not stage.episode.anchor.any()


def test_an_episode_begins_in_a_state_beside_that_of_the_reference(stage: Stage) -> None:
    joints, row = stage.worlds.body.joints, 7
    noise = np.random.default_rng(8).normal(size=N)

    compiled.begin(stage.episode, row, noise, stage.table, joints)

    off = stage.worlds.model.message_position(stage.episode.position)
    off -= stage.worlds.model.message_position(stage.table.positions[row])
    assert 0.01 < np.abs(off[6:]).max() < 0.3
    assert not off[:6].any()
    faster = stage.episode.velocity - stage.table.velocities[row]
    np.testing.assert_allclose(faster, np.repeat((0.15, 0.4), (3, N - 3)) * noise)
    for start in (3, *joints.ball_positions):
        assert np.linalg.norm(stage.episode.position[start : start + 4]) == pytest.approx(1.0)


def test_an_episode_whose_reference_is_over_is_cut(stage: Stage) -> None:
    hold = stage.worlds.rules.hold
    last = int(stage.table.ends[0])
    row = last - 2 * hold
    stage.begin(stage.table, row)

    trace = stage.go_on(3)

    assert trace.ends.tolist() == [CUT, CUT, CUT]
    assert trace.lengths.tolist() == [1, 1, 1]
    assert (trace.rewards > 0.3).all()
    assert stage.episode.counts[0] == row


def test_a_state_that_diverges_ends_the_episode_and_says_nothing_infinite(stage: Stage) -> None:
    stage.episode.velocity[3] = 2e3

    trace = stage.go_on(2)

    assert trace.ends.tolist() == [FELL, 0]
    for column in (trace.observations, trace.after, trace.rewards):
        assert np.isfinite(column).all()


def test_every_start_is_a_row_of_its_own_reference() -> None:
    """Also of a clip that wraps and is longer than an episode needs to be."""
    (walk,) = JOB.references
    stage = Stage()
    try:
        model, body = stage.worlds.model, stage.worlds.body
        references = [TrainedReference(walk.reference, 21.0, wraps) for wraps in (True, False)]
        table, starts = make_table(model, body, references, 30)
        for rows in (stretch.rows for stretch in starts):
            assert set(table.ends[rows]) == {table.ends[rows[0]]}
            assert (rows < table.ends[rows] - table.ahead[-1]).all()
        longer = replace(references[0], cycle_s=1.0, lasts_s=30.0, weight=0.25)
        table, (start,) = make_table(model, body, [longer], 30)
        assert len(table.ends) >= 31 * 30
        assert (start.count, start.weight) == (30, 0.25)
    finally:
        stage.worlds.close()


def test_a_trace_has_the_row_of_each_decision(stage: Stage) -> None:
    stage.begin(stage.table, row=40)

    trace = stage.go_on(3)

    assert not trace.ends.any()
    assert trace.rows.tolist() == [40, 48, 56]
