"""The fit of the balance feedback to a motion, and the angular momentum that its cost looks at."""

from dataclasses import replace

import numpy as np
import pytest
from physics import character

from controller_node.dynamics import DynamicsModel
from controller_node.feedback_gains import FeedbackGains
from experiment.cli import main
from experiment.samcon.features import Features
from experiment.samcon.fitting import fitted, mean_cost, names
from experiment.samcon.problem import Problem
from experiment.samcon.settings import preset
from msgs_config import rotations
from msgs_config.arrays import FloatArray

HUMANOID = character("humanoid")
SIZE = HUMANOID.layout.size
SETTINGS = preset("humanoid", "jump")
PROBLEM = Problem.of("humanoid", "jump", 0.2, SETTINGS)


def position() -> FloatArray:
    """A bent and turned position (n,)."""
    found = np.array(HUMANOID.rest_position) + 0.3 * np.sin(np.arange(SIZE))
    found[HUMANOID.layout.joint("right_knee").start] = -0.5
    found[HUMANOID.layout.joint("left_knee").start] = -0.2
    return found


def momentum(velocity: FloatArray) -> FloatArray:
    """The angular momentum (3,) among the features."""
    return Features(HUMANOID).row(position(), velocity)[2 * SIZE + 6 : 2 * SIZE + 9]


def test_who_moves_on_without_turning_has_no_angular_momentum() -> None:
    velocity = np.zeros(SIZE)
    velocity[:3] = (1.0, -2.0, 3.0)

    np.testing.assert_allclose(momentum(velocity), 0.0, atol=1e-9)


def test_who_turns_as_one_body_has_that_of_twice_its_energy() -> None:
    spin = np.array((0.5, -1.0, 2.0))  # rad/s, world
    model = DynamicsModel(HUMANOID)
    model.update(position(), np.zeros(SIZE))
    velocity = np.zeros(SIZE)
    velocity[:3] = np.cross(spin, position()[:3] - model.centre_of_mass())
    back = rotations.conjugate(rotations.exp(position()[3:6]))
    velocity[3:6] = rotations.rotate(back, spin)

    model.update(position(), velocity)

    assert momentum(velocity) @ spin == pytest.approx(2.0 * model.kinetic_energy())


def test_what_is_fitted_are_gains() -> None:
    assert FeedbackGains.of(dict.fromkeys(names(), 1.0)).stance.any()


def test_the_fit_is_the_same_on_two_processes_and_costs_what_it_says() -> None:
    told: list[float] = []

    without = replace(PROBLEM, feedback={})

    alone = fitted(without, SETTINGS, 16, 1, lambda _, least: told.append(least))
    together = fitted(without, SETTINGS, 16, 2)

    assert alone == together
    assert told == [mean_cost(PROBLEM, SETTINGS, alone)]
    assert told[0] < mean_cost(PROBLEM, SETTINGS, {})


def test_a_fit_never_ends_with_worse_gains_than_it_began_with() -> None:
    best = fitted(PROBLEM, SETTINGS, 16, 1)
    for _ in range(2):  # a fit of what was fitted tries other gains around it
        better = fitted(replace(PROBLEM, feedback=best), SETTINGS, 16, 1)

        costs = [mean_cost(PROBLEM, SETTINGS, gains) for gains in (better, best)]
        assert costs[0] <= costs[1]
        best = better


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--fit", "-1"), "--fit is -1"),
        (("--fit", "16", "--open-loop"), "which --open-loop leaves out"),
        (("--fit", "16", "--resume"), "--resume goes on with what was fitted before"),
        (("--fit", "16", "--cluster", "localhost:1"), "not on a --cluster"),
        (("--seed", "-1"), "seed is -1; it must be 0 to 4294967294"),
        (("--seed", "4294967295"), "seed is 4294967295"),
    ],
)
def test_a_wrong_fit_is_one_line(
    tmp_path_factory: pytest.TempPathFactory,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    reason: str,
) -> None:
    output = tmp_path_factory.mktemp("fit") / "jump.json"

    assert main(["reconstruct", "--output", str(output), *options]) != 0
    assert reason in capsys.readouterr().err
