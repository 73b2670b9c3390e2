"""The study `tick`: its stages against what the simulator has sent, and the bars of its times."""

import itertools

import mujoco
import numpy as np
import pytest

from actuated_characters.bags.recording import Recording
from lecture import tick
from lecture.framework.result import StudyResult
from lecture.framework.study import WALK, RunSpec
from lecture.tick.stages import STAGES, StagedTick, TickStages, pairs_that_may_touch
from msgs_config.character.dynamics import DynamicsModel
from tests.support.in_process import InProcessRunner

pytestmark = pytest.mark.slow

HINGED = """
<mujoco>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="a">
      <freejoint/>
      <geom size="0.1"/>
      <geom size="0.2"/>
      <body name="b">
        <joint/>
        <geom size="0.1"/>
        <body name="fixed to b">
          <geom size="0.1"/>
        </body>
        <body name="c">
          <joint/>
          <geom size="0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
  <contact>
    <exclude body1="a" body2="b"/>
  </contact>
</mujoco>
"""


@pytest.fixture(scope="module")
def walked(runner: InProcessRunner) -> Recording:
    """Half a second of walking on engine MuJoCo, its contacts recorded."""
    case = RunSpec("short", "humanoid", 0.5, WALK, {"engine": "mujoco"}, contacts=True)
    return runner.run(case).recording


@pytest.fixture(scope="module")
def ticks(walked: Recording) -> list[TickStages]:
    world = StagedTick(walked)
    states = zip(walked.position[:-1], walked.velocity[:-1], walked.effort, strict=True)
    return [world.run(*state) for state in states]


@pytest.fixture(scope="module")
def result(runner: InProcessRunner) -> StudyResult:
    return runner.study("tick")


def test_the_stages_lead_to_the_state_that_the_simulator_has_sent(
    walked: Recording, ticks: list[TickStages]
) -> None:
    velocity = np.array([each.velocity for each in ticks])
    np.testing.assert_allclose(velocity, walked.velocity[1:], atol=1e-6)
    world = StagedTick(walked)
    for each, sent in zip(ticks, walked.position[1:], strict=True):
        wanted = world.numbers(sent)
        sign = np.where(np.abs(each.position + wanted) < np.abs(each.position - wanted), -1, 1)
        np.testing.assert_allclose(sign * each.position, wanted, atol=1e-8)


def test_the_contacts_force_is_that_of_the_message(
    walked: Recording, ticks: list[TickStages]
) -> None:
    """On the plane the normals point up; a walk's links do not touch one another."""
    for each, touch in zip(ticks, walked.contacts, strict=True):
        sent = 0.0 if touch is None else float(touch.wrenches[:, 2].sum())
        assert each.force == pytest.approx(sent, abs=1e-3)
        assert each.impulse == pytest.approx(sent / 240.0, abs=1e-5)
        assert each.rows >= 3 * each.contacts
    assert max(each.force for each in ticks) > 100.0


def test_pairs_that_may_touch_are_of_bodies_that_move_against_each_other() -> None:
    """The plane with 5 shapes; a's 2 with c's, as b's are excluded; those of b with c's.

    What is fixed to b is a body of its own to the exclusion, which so leaves its pairs with a's.
    """
    model = mujoco.MjModel.from_xml_string(HINGED)

    assert pairs_that_may_touch(model) == 5 + 2 + 2 + 2


def test_the_entries_of_the_mass_matrix_are_of_joints_that_carry_one_another(
    walked: Recording,
) -> None:
    links, expected = walked.character.links, 0
    sizes = [len(link.joint.type.suffixes) for link in links]
    for own, link in zip(sizes, links, strict=True):
        expected += own * own
        above = link.parent
        while above >= 0:
            expected += 2 * own * sizes[above]
            above = links[above].parent

    assert tick._entries(StagedTick(walked)) == expected
    model = DynamicsModel(walked.character)
    model.update(walked.position[20], walked.velocity[20])
    assert expected - 12 <= np.count_nonzero(model.mass_matrix()) <= expected


def test_the_table_has_every_stage_and_the_sweeps_that_the_simulator_is_set_to(
    result: StudyResult,
) -> None:
    parts = {(row["engine"], row["part"]): row for row in result.rows}

    assert [row["part"] for row in result.rows][: len(STAGES)] == list(STAGES)
    assert parts["mujoco", "solve"]["median"] == 2 * 10
    assert parts["mujoco", "collision detection"]["median"] >= 1
    assert all(row["time (us)"] > 0.0 for row in result.rows)


def test_the_bars_of_a_ticks_time_follow_one_another(result: StudyResult) -> None:
    bars = result.figures["tick"].axes[2].patches

    engines = [list(group) for _, group in itertools.groupby(bars, lambda bar: bar.get_y())]
    assert len(engines) == tick.RUNS
    for each in engines:
        assert each[0].get_x() == 0.0 and len(each) == 3  # physics, control, the rest of a tick
        for bar, following in itertools.pairwise(each):
            assert following.get_x() == pytest.approx(bar.get_x() + bar.get_width())
