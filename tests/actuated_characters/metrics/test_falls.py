import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.metrics.falls import (
    FALLEN_TIME,
    FallWatch,
    PostureReader,
    PostureSeries,
    fall_row,
    is_down,
    reader_for,
    tilts,
)
from actuated_characters.metrics.run_metrics import Measurement, Tick
from lecture.framework.study import RunResult, RunSpec, plan_push
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Placement, UrdfOptions
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from msgs_config.messages import configuration
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedReference, StampedState
from tests.support.bags import make_run
from tests.support.in_process import InProcessRunner
from tests.support.physics import character

RATE = 240
HELD = math.ceil(FALLEN_TIME * RATE)
OF_THE_SIMULATOR = {"initial_position"}
UP = np.array((0.0, 0.0, 1.0))
POST = """<robot name="post"><link name="post"><inertial><mass value="{mass}"/>
<inertia ixx="0.4" ixy="0" ixz="0" iyy="0.4" iyz="0" izz="0.01"/></inertial>
<collision><geometry><box size="0.1 0.1 {height}"/></geometry></collision></link></robot>"""


def posture(height: float, tilt_deg: float = 0.0, rows: int = 1) -> PostureSeries:
    angle = math.radians(tilt_deg)
    up = np.array((math.sin(angle), 0.0, math.cos(angle)))
    return PostureSeries(np.full(rows, height), np.tile(up, (rows, 1)))


NOTHING = PostureSeries(np.array((np.nan,)), np.full((1, 3), np.nan))


# The measure


@pytest.mark.parametrize(
    ("body", "desired", "down"),
    [
        (posture(0.46), NOTHING, False),
        (posture(0.44), NOTHING, True),
        (posture(-19.0), NOTHING, True),
        (posture(0.9, 59.0), NOTHING, False),
        (posture(0.9, 61.0), NOTHING, True),
        (posture(0.1, 90.0), posture(0.1, 90.0), False),  # lies, as it should
        (posture(0.1, -90.0), posture(0.1, 90.0), True),  # on the other side
        (posture(0.3), posture(1.5), True),
        (posture(0.46), posture(1.5), False),  # a reference in the air asks for no more
        (posture(0.9, 180.0), posture(1.2, 180.0), False),  # a somersault
        (posture(0.9), posture(0.1, 90.0), True),  # a body that stands where it should lie
    ],
)
def test_it_is_down_where_it_is_low_or_tilted_against_what_it_should_be(
    body: PostureSeries, desired: PostureSeries, down: bool
) -> None:
    assert is_down(body, desired, standing_height=0.9).tolist() == [down]


def test_tilts_are_angles_from_the_vertical_or_from_a_desired_axis() -> None:
    up = np.stack([UP, (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
    desired = np.stack([np.full(3, np.nan), np.full(3, np.nan), (0.0, 1.0, 0.0)])

    assert tilts(up, desired) == pytest.approx([0.0, math.pi / 2, math.pi / 2])


@pytest.mark.parametrize(
    ("down", "ticks", "row"),
    [
        ([False] * 5 + [True] * HELD, None, 5),
        ([False] * 5 + [True] * (HELD - 1) + [False], None, None),
        ([True] * (HELD - 1) + [False] + [True] * HELD, None, HELD),
        ([True] * HELD, [*range(HELD - 1), HELD], None),  # a tick between two episodes
        ([], None, None),
    ],
)
def test_a_fall_begins_where_it_is_down_for_long_enough(
    down: Sequence[bool], ticks: Sequence[int] | None, row: int | None
) -> None:
    numbers = np.array(range(len(down)) if ticks is None else ticks, dtype=float)

    assert fall_row(np.array(down, dtype=bool), numbers, RATE) == row


# Postures of characters


def test_a_humanoid_stands_as_high_as_its_centre_of_mass_is_above_its_soles() -> None:
    humanoid = character("humanoid")
    rest = np.array(humanoid.rest_position)
    lying = rest.copy()
    lying[2] = 0.1
    quarter = rotations.multiply(rotations.about_z(0.3), rotations.exp(np.array((1.5708, 0, 0))))
    lying[3:6] = rotations.log(rotations.multiply(quarter, rotations.exp(rest[3:6])))

    reader = PostureReader(humanoid)
    found = reader.read(np.stack([rest, lying, np.full_like(rest, np.nan)]))

    assert 0.8 < reader.standing_height < 1.1  # of a body of 1.6 m
    assert found.height[0] == pytest.approx(reader.standing_height, abs=0.1)
    assert found.height[1] < 0.3
    assert tilts(found.up[:2], np.full((2, 3), np.nan)) == pytest.approx([0.0, 1.5708], abs=1e-6)
    assert np.isnan(found.height[2]) and np.isnan(found.up[2]).all()


def test_a_placed_character_stands_where_it_is_placed() -> None:
    here = character("humanoid")
    raised = ac.load_character("humanoid")
    raised = raised.placed(Placement(1.0, 2.0, 3.0, 0.7))

    readers = PostureReader(here), PostureReader(raised)

    assert readers[0].standing_height == pytest.approx(readers[1].standing_height)
    (up,) = readers[1].read(np.array(raised.rest_position)[np.newaxis]).up
    assert up == pytest.approx(UP)


def test_what_cannot_fall_has_no_posture() -> None:
    assert reader_for(character("pendulum")) is None
    with pytest.raises(CharacterError, match="fixed base"):
        PostureReader(character("pendulum"))


def test_height_is_above_the_ground_beneath(tmp_path: Path) -> None:
    box = POST.replace("0.1 0.1 {height}", "2 2 0.5").format(mass=0, height=0)
    terrain = tmp_path / "step.urdf"
    terrain.write_text(box)
    humanoid = character("humanoid")
    rest = np.array(humanoid.rest_position)
    on_the_step, beside = rest.copy(), rest.copy()
    on_the_step[2] += 0.25  # half of the box is above z = 0
    beside[0] += 5.0

    reader = PostureReader(humanoid, UrdfOptions(terrain, box, fixed_base=True))
    heights = reader.read(np.stack([on_the_step, beside])).height

    assert heights[0] == pytest.approx(heights[1], abs=1e-6)


def test_a_watch_tells_a_fall_as_soon_as_it_lasted() -> None:
    humanoid = character("humanoid")
    rest = np.array(humanoid.rest_position)
    low = rest.copy()
    low[2] -= 0.7
    watch = FallWatch(PostureReader(humanoid), RATE)

    told = [watch.has_fallen(low) for _ in range(HELD)]

    assert told == [False] * (HELD - 1) + [True]
    assert not watch.has_fallen(rest)
    assert not any(watch.has_fallen(low, desired=low) for _ in range(2 * HELD))


# Measured runs


def urdf_of(folder: Path, height: float) -> str:
    file = folder / "post.urdf"
    file.write_text(POST.format(mass=5, height=height))
    return str(file)


def run_of(folder: Path, name: str, duration: float, **given: object) -> RunResult:
    simulator = {key: given.pop(key) for key in OF_THE_SIMULATOR & given.keys()}
    spec = RunSpec("run", name, duration, simulator=simulator, controller=given)
    return InProcessRunner(folder).run(spec)


def tilt_of(position: FloatArray) -> float:
    """The tilt in rad of a body that is upright without a turn."""
    return math.acos(float(rotations.rotate(rotations.exp(position[3:6]), UP)[2]))


@pytest.mark.parametrize("height", [0.2, 0.4, 1.0, 2.0])
def test_a_post_that_topples_fell_whatever_its_size(tmp_path: Path, height: float) -> None:
    leans = [0.0, 0.0, 0.4 * height + 0.05, 0.8, 0.0, 0.0]
    run = run_of(tmp_path, urdf_of(tmp_path, height), 2.5, initial_position=leans)

    last = run.recording.position[-1]
    assert tilt_of(last) > 1.4 and last[2] < 0.3 * height  # it lies, by the test's own eyes
    assert run.summary["fell"] is True


def test_a_post_that_stands_did_not_fall(tmp_path: Path) -> None:
    summary = run_of(tmp_path, urdf_of(tmp_path, 1.0), 1.0).summary

    assert summary["fell"] is False
    assert summary["fell_at_s"] is summary["fell_in_mode"] is None


def test_a_fall_through_a_ground_that_nothing_touches_is_a_fall(tmp_path: Path) -> None:
    run = run_of(tmp_path, urdf_of(tmp_path, 1.0), 2.0, collision="none")

    assert run.recording.position[-1, 2] < -10.0  # m
    assert run.summary["fell"] is True


def test_a_ragdoll_falls_and_says_that_it_was_limp(tmp_path: Path) -> None:
    run = run_of(tmp_path, "humanoid", 2.0, behaviour="ragdoll", law="zero")

    assert run.recording.position[-1, 2] < 0.4  # m: it lies, by the test's own eyes
    assert run.summary["fell"] is True and run.summary["fell_in_mode"] == "LIMP"
    assert 0.2 < float(str(run.summary["fell_at_s"])) < 1.5


@pytest.mark.slow
def test_a_machine_that_is_thrown_down_fell_and_its_root_has_no_error(tmp_path: Path) -> None:
    spec = RunSpec(
        "machine",
        "humanoid",
        4.0,
        controller={"behaviour": "state_machine", "machine": "walk", "reference": "steered"},
        simulator={"wrench_duration": 0.2},
        pushes=[plan_push(1.0, RATE, "chest", (500.0, 0.0, 0.0))],
    )

    run = InProcessRunner(tmp_path).run(spec)

    heights = run.recording.position[:, 2]
    assert run.diverged or heights.min() < 0.2  # m: the root has lain on the ground
    assert run.summary["fell"] is True and run.summary["fell_in_mode"] == "STATE"
    assert run.summary["root_error_mean_m"] is run.summary["root_error_max_m"] is None


# References that follow


def following(offset: float, moves: bool = True) -> dict[str, object]:
    """The figures of a humanoid that sinks, with a reference `offset` m above where it is."""
    humanoid = character("humanoid")
    made = make_run("humanoid", 0.01)
    known = configuration.parse(configuration.describe(humanoid, made.plan.simulator))
    measurement, clock = Measurement(known, PostureReader(humanoid)), TickClock(RATE)
    rest = np.array(humanoid.rest_position)

    def at(tick: int) -> FloatArray:
        position: FloatArray = rest.copy()
        if moves:
            position[2] = max(rest[2] - 0.01 * tick, 0.15) + 1e-7 * tick
            position[6:] += 1e-4 * tick
        return position

    none = np.zeros(len(rest))
    for tick in range(1, 400):
        state = StampedState(clock.stamp_ns(tick), at(tick), none, none)
        later = StampedState(clock.stamp_ns(tick + 1), at(tick + 1), none, none)
        desired = at(tick)
        desired[2] += offset
        measurement.add(Tick(state, later, StampedReference(state.stamp_ns, desired, none)))
    return measurement.summary(1.0)


def test_a_reference_that_is_the_state_judges_nothing() -> None:
    summary = following(offset=0.0)

    assert summary["fell"] is True
    assert summary["root_error_mean_m"] is summary["joint_error_mean_rad"] is None
    assert following(offset=0.02)["root_error_mean_m"] == pytest.approx(0.02)


def test_a_reference_that_is_met_at_rest_is_met() -> None:
    summary = following(offset=0.0, moves=False)

    assert summary["root_error_mean_m"] == 0.0 and summary["joint_error_mean_rad"] == 0.0
    assert summary["fell"] is False
