"""The offsets from a motion's inverse dynamics, around which sampling-based control draws."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from physics import character

from controller_node.parameters import make_controller
from controller_node.references.base import ReferenceState
from controller_node.references.corrected import Offset
from experiment.samcon import cost
from experiment.samcon.feedforward import Feedforward
from experiment.samcon.problem import Problem
from experiment.samcon.rollout import Branch, Expansion, Rollout
from experiment.samcon.settings import preset
from msgs_config.arrays import FloatArray
from msgs_config.dynamics import DynamicsModel
from msgs_config.stamped import StampedState
from msgs_config.tick_clock import FIRST_TICK

HUMANOID = character("humanoid")
LAYOUT = HUMANOID.layout
PROBLEM = Problem("humanoid", "jump", duration=0.3, window=0.1, feedforward=1.0)


class Still:
    """A motion that rests in one position, with an offset or none."""

    def __init__(self, position: FloatArray, offset: FloatArray | None = None) -> None:
        nothing = np.zeros(LAYOUT.size)
        state = ReferenceState(LAYOUT.configuration(position), nothing, nothing)
        self._state = state if offset is None else Offset(LAYOUT, offset).applied(state)

    def sample(self, time: float) -> ReferenceState:
        return self._state


@pytest.fixture(scope="module")
def rollout() -> Iterator[Rollout]:
    rollout = Rollout(PROBLEM)
    yield rollout
    rollout.close()


def test_the_laws_effort_leaves_the_weight_to_the_feet() -> None:
    position = np.array(HUMANOID.rest_position)
    position[2] = 0.9
    values = PROBLEM.plan().controller
    unaided = make_controller(HUMANOID, Still(position), values)
    feedforward = Feedforward(
        HUMANOID, Still(position), unaided.settings.gains, unaided.clock.period_s
    )

    offset = feedforward.offset((0.1,))
    controller = make_controller(HUMANOID, Still(position, offset), values)
    stamp = controller.clock.stamp_ns(FIRST_TICK)
    effort, _ = controller.answer(StampedState(stamp, position, 0.0 * position, None), stamp)

    model = DynamicsModel(HUMANOID)
    model.update(position, 0.0 * position)
    names = [link.name for link in HUMANOID.links]
    ground = np.vstack([model.link_jacobian(names.index(foot)) for foot in HUMANOID.feet])
    carried = model.bias_force() - effort
    wrenches = np.linalg.lstsq(ground.T, carried, rcond=None)[0]
    assert not offset[:6].any()
    np.testing.assert_allclose(ground.T @ wrenches, carried, atol=1e-2)
    assert wrenches[2] + wrenches[8] == pytest.approx(model.weight, rel=1e-4)


def test_what_flies_needs_no_effort_against_its_weight() -> None:
    position = np.array(HUMANOID.rest_position)
    position[2] = 3.0
    gains = make_controller(HUMANOID, Still(position), PROBLEM.plan().controller).settings.gains

    offset = Feedforward(HUMANOID, Still(position), gains, 1.0 / 240.0).offset((0.1,))

    knees = LAYOUT.mask(("right_knee", "left_knee"))
    assert np.abs(offset[knees]).max() < 0.02  # of the shank alone


def test_without_a_share_a_window_begins_from_nothing(rollout: Rollout) -> None:
    without = Rollout(replace(PROBLEM, feedforward=0.0))

    assert not without.plain(1).any()
    assert rollout.plain(1).any()
    without.close()


def test_with_it_alone_a_jump_stays_nearer_to_its_motion(rollout: Rollout) -> None:
    nothing = np.zeros(LAYOUT.size)
    samples = np.array((nothing, rollout.plain(0)))
    without = Rollout(replace(PROBLEM, feedforward=0.0))

    costs = [
        _costs(engine, engine.expand(Branch(None, 0, samples[:0], nothing, sample[np.newaxis], 2)))
        for engine, sample in zip((without, rollout), samples, strict=True)
    ]

    assert (costs[1][1:] < 0.9 * costs[0][1:]).all()
    without.close()


def _costs(rollout: Rollout, expansion: Expansion) -> FloatArray:
    """The cost of the first sample at the end of each window."""
    settings = preset("humanoid", "jump")
    rows = expansion.features[0]
    terms = [
        cost.terms(LAYOUT, 0.9, row[np.newaxis], rollout.desired(window), settings.bounds)
        for window, row in enumerate(rows)
    ]
    return np.array([term.cost(settings.weights)[0] for term in terms])
