"""The study `equation`: what is left of the equation of motion, and what shows that it is right."""

from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording
from lecture.equation import close
from lecture.framework.study import RunSpec
from msgs_config.messages.wrenches import WrenchArrays
from tests.support.in_process import InProcessRunner

pytestmark = pytest.mark.slow

ROUNDING = 1e-10
NOTICED = 1e-3


@pytest.fixture(scope="module")
def stood(runner: InProcessRunner) -> Recording:
    """Half a second of standing with assistance, its contacts recorded."""
    return runner.run(RunSpec("short", "humanoid", 0.5, contacts=True)).recording


def test_the_equation_closes_in_every_tick_and_not_without_the_contacts(
    runner: InProcessRunner,
) -> None:
    result = runner.study("equation")

    assert result.column("run") == ["walk", "stand", "fall"]
    assert max(result.column("largest")) < ROUNDING
    assert min(result.column("p50 without contacts")) > 0.1


def test_standing_still_ground_and_assistance_carry_the_weight(stood: Recording) -> None:
    # Arrange: the last quarter, when it has come to rest
    ticks = range(90, 120)
    weight = 9.81 * stood.character.mass

    for tick in ticks:
        # Act
        touching = stood.contacts[tick]
        assert touching is not None
        carried = touching.wrenches[:, 2].sum() + stood.effort[tick, 2]

        # Assert
        assert carried == pytest.approx(weight, rel=0.02)


@pytest.mark.parametrize("what", ["contact", "effort", "velocity"])
def test_what_was_not_so_shows(stood: Recording, what: str) -> None:
    # Arrange
    assert close(stood).relative.max() < ROUNDING
    effort, velocity, contacts = stood.effort.copy(), stood.velocity.copy(), list(stood.contacts)
    tick, chest = 60, stood.layout.dof_names.index("chest_x")

    # Act
    if what == "contact":
        touching = contacts[tick]
        assert touching is not None
        contacts[tick] = WrenchArrays(
            touching.stamp_ns, touching.links, 1.1 * touching.wrenches, touching.points
        )
    elif what == "effort":
        effort[tick, chest] += 5.0
    else:
        velocity[tick + 1, chest] += 0.01
    altered = replace(stood, effort=effort, velocity=velocity, contacts=tuple(contacts))
    relative = close(altered).relative

    # Assert: in that tick, and, of a velocity, in the next one that begins with it
    shown = np.flatnonzero(relative > NOTICED).tolist()
    assert shown == ([tick, tick + 1] if what == "velocity" else [tick])
