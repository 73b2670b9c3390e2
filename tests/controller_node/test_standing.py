"""The robots that ship hold their rest pose under stable PD, as a user sees them first."""

import numpy as np
import pytest

from tests.support.physics import (
    LoneSimulation,
    character,
    controller,
    link_poses,
    run_together,
    simulation,
)

RATE_HZ = 240
TOES = ["toeFR", "toeFL", "toeRR", "toeRL"]
TOE_RADIUS = 0.03  # m, in the robot's URDF


def stand(name: str, seconds: float, with_root: bool) -> tuple[LoneSimulation, float]:
    """A simulation whose rest pose was held, and the largest share of an effort limit used."""
    layout = character(name).layout
    commanded = [*(["root"] if with_root else []), *layout.actuated_joint_names]
    run = simulation(name, commanded_joints=commanded)
    driver = controller(name, reference="hold", root_assistance=with_root)
    limits = character(name).effort_limits()
    ticks = run_together(run, driver, round(seconds * RATE_HZ))
    share = max(float((layout.norms(effort) / limits).max()) for _, effort, _ in ticks)
    return run, share


@pytest.mark.parametrize("name", ["franka_panda", "kuka"])
def test_an_arm_holds_its_rest_pose(name: str) -> None:
    run, share = stand(name, seconds=4.0, with_root=False)

    assert np.abs(run.state.velocity).max() < 1e-6
    assert run.state.position == pytest.approx(character(name).rest_position, abs=0.1)
    assert share < 0.5


@pytest.mark.parametrize("with_root", [True, False])
def test_the_quadruped_stands_still_on_its_four_feet(with_root: bool) -> None:
    # Arrange
    whole = character("laikago")
    toes = [index for index, link in enumerate(whole.links) if link.name in TOES]

    # Act
    run, share = stand("laikago", seconds=6.0, with_root=with_root)

    # Assert
    assert np.abs(run.state.velocity).max() < 0.01
    assert run.state.position == pytest.approx(whole.rest_position, abs=0.1)
    origins, _ = link_poses(run.simulated._body, whole)
    assert origins[toes, 2] == pytest.approx(TOE_RADIUS, abs=0.003)
    assert share < 0.2


def test_the_rest_pose_of_the_quadruped_has_its_toes_on_the_ground_below_its_hips() -> None:
    whole = character("laikago")
    run = simulation("laikago")

    origins, _ = link_poses(run.simulated._body, whole)

    places = {link.name: origin for link, origin in zip(whole.links, origins, strict=True)}
    for toe in TOES:
        assert places[toe][2] == pytest.approx(TOE_RADIUS, abs=0.001)
        hip = places[f"{toe.removeprefix('toe')}_upper_leg"]
        assert places[toe][:2] == pytest.approx(hip[:2], abs=0.03)
