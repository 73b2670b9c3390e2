"""Balls that are thrown at a link in a run: they hit it when they should, and are replayed."""

import re
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_commands
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.throw_hits import (
    States,
    describe_hits,
    find_hit,
    read_states,
)
from actuated_characters.runs.planned.throw_requests import ThrowRequest, parse_throw
from actuated_characters.runs.planned.throws import (
    PlannedThrow,
    plan_throw,
    plan_throws,
)
from actuated_characters.runs.planned.wrenches import plan_push
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.geometry import rotations
from msgs_config.messages.clock import TickClock
from msgs_config.messages.throw import ProjectileThrow, natural_radius
from sim_node.physics.balls.sphere_sweep import find_impact
from sim_node.physics.engine import DEFAULT_ENGINE
from sim_node.physics.simulation import Simulation
from tests.support.engines import links_at_ball
from tests.support.physics import character
from tests.support.runs import run_plan
from tests.support.thrown_states import watch_states

RATE = 240
CLOCK = TickClock(RATE)
HUMANOID = character("humanoid")
LINKS = [link.name for link in HUMANOID.links]
HELD = {"reference": "hold"}
WALK = {"reference": "clip", "clip": "walk"}


def plan_of(
    seconds: float = 1.0, reference: dict[str, object] | None = None, **simulator: object
) -> RunPlan:
    return make_plan("humanoid", seconds, reference or HELD, simulator, {})


def first_hit(plan: RunPlan, planned: PlannedThrow) -> tuple[int, frozenset[str], FloatArray]:
    """Run a plan until a ball first touches the character, by the engine's own list.

    Returns the tick of the state after that step, the links that it touches, and its motion (13,)
    in the state before. The command finds the same.
    """
    states: States = []
    found: list[tuple[int, frozenset[str]]] = []

    def watch(run: Simulation) -> None:
        watch_states(states, run)
        if run._world.balls.throws and (links := links_at_ball(run, 0)):
            found.append((run.tick, links))

    for _ in ticks_in_process(plan, (), [planned], watch=watch):
        if found:
            break
    (tick, links) = found[0]
    time, link = find_hit(plan, [planned], 0, states) or (0.0, "")
    assert (round(time * RATE), link in links) == (tick - 1, True)
    return tick, links, states[-2][1][0]


# Aiming


@pytest.mark.slow
@pytest.mark.parametrize("side", ["front", "left", "back", "right", "above", "37.5"])
@pytest.mark.parametrize("reference", [HELD, WALK], ids=["hold", "walk"])
def test_a_ball_hits_its_target_at_its_time_from_its_side(
    side: str, reference: dict[str, object]
) -> None:
    plan = plan_of(1.0, reference)
    speed = 6.0 if reference is HELD else 12.0  # a walk is some centimetres from its reference

    planned, before = plan_throw(plan, ThrowRequest(1.0, speed, 0.8, "neck", side, radius=0.06))
    tick, links, motion = first_hit(plan, planned)

    assert before == () and links == {"neck"}
    assert abs((tick - 1) - 0.8 * RATE) <= 2.0
    came = -motion[7:10] / np.linalg.norm(motion[7:10])
    angle = {"front": 0.0, "left": 90.0, "back": 180.0, "right": 270.0}.get(side)
    expected = np.array((0.0, 0.0, 1.0))
    if side != "above":
        radians = np.deg2rad(float(side) if angle is None else angle)
        expected = np.array((np.cos(radians), np.sin(radians), 0.0))
    slack = 0.35 if side != "above" else 0.05  # it falls on its way, and the walk sways
    assert np.arccos(came @ expected) < slack


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
@pytest.mark.parametrize("side", ["front", "left"])
def test_a_box_slides_to_its_target_at_its_time_and_speed(side: str, engine: str) -> None:
    plan = plan_of(1.0, engine=engine)
    size = (0.3, 0.2, 0.1)
    request = ThrowRequest(
        4.0, 3.0, 0.8, "left_ankle", side, 1.5, shape="box", size=size, slide=True
    )

    planned, _ = plan_throw(plan, request)
    states: States = []
    watch = partial(watch_states, states)
    ticks = list(ticks_in_process(plan, (), [planned], watch=watch))

    assert len(ticks) == RATE
    hit = find_hit(plan, [planned], 0, states)
    assert hit is not None and hit[1] == "left_ankle"
    assert abs(hit[0] - 0.8) <= 3.0 / RATE
    (last,) = states[round(hit[0] * RATE) - 4][1]
    assert np.linalg.norm(last[7:10]) == pytest.approx(3.0, rel=0.02)
    assert last[2] == pytest.approx(0.05, abs=2e-3)


@pytest.mark.parametrize(("radius", "distance"), [(0.005, 8.0), (0.0078, 20.0), (0.1, 300.0)])
def test_a_small_ball_from_far_away_is_aimed_at_the_surface(radius: float, distance: float) -> None:
    position = np.array(HUMANOID.rest_position)
    ahead = np.array((1.0, 0.0, 0.0))

    ball = ProjectileThrow(1.0, radius, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    far = find_impact(HUMANOID, position, "chest", ahead, ball, distance)
    near = find_impact(HUMANOID, position, "chest", ahead, ball, 1.0)

    assert far.centre == pytest.approx(near.centre, abs=1e-5)
    assert far.before == near.before == ()


def test_a_side_turns_with_the_character() -> None:
    turned = plan_of(placement=[1.0, 2.0, 0.0, np.pi / 2.0])
    request = ThrowRequest(1.0, 6.1, 0.8, "neck", "front", radius=0.06)

    throw, _ = plan_throw(turned, request)
    planned, _ = plan_throw(plan_of(), request)

    x, y, z = planned.throw.position
    assert throw.throw.position == pytest.approx((1.0 - y, 2.0 + x, z), abs=1e-5)
    vx, vy, vz = planned.throw.velocity
    assert throw.throw.velocity == pytest.approx((-vy, vx, vz), abs=1e-5)


@pytest.mark.parametrize(
    "simulator", [{}, {"substeps": 3}, {"gravity": 0.0}, {"rate": 500}], ids=str
)
def test_a_ball_flies_at_its_speed_and_upwards_as_gravity_takes_away(
    simulator: dict[str, object],
) -> None:
    plan = plan_of(**simulator)
    rate = plan.simulation.rate_hz

    planned, _ = plan_throw(plan, ThrowRequest(1.0, 5.0, 0.9, "neck", "right", 3.0, 0.06))

    vx, vy, vz = planned.throw.velocity
    time = 0.9 - (TickClock(rate).first_tick_from(planned.stamp_ns) - 1) / rate
    step = 1.0 / (rate * plan.simulation.substeps)
    gravity = plan.simulation.world.gravity
    assert (vx, vy) == pytest.approx((0.0, 5.0), abs=1e-9)
    assert vz == pytest.approx(0.5 * gravity * (time + step), abs=1e-9)
    # it comes to the neck's surface, which is half a hand from its middle
    assert planned.throw.position[1] == pytest.approx(-3.0, abs=0.02)
    assert time * 5.0 == pytest.approx(3.0, abs=0.25)


def test_what_is_in_the_way_is_said() -> None:
    throws, warnings = plan_throws(
        plan_of(), ["mass=2 speed=8 at=0.8 from=right target=left_wrist"]
    )

    assert len(throws) == 1
    (note,) = warnings
    assert "right_" in note and "in its way" in note


# What is refused


def test_a_throw_is_read_as_it_is_written() -> None:
    assert parse_throw("mass=2 speed=8 at=2.0 from=left target=chest") == ThrowRequest(
        2.0, 8.0, 2.0, "chest", "left"
    )
    assert parse_throw(
        "at=1,speed=3,target=neck,mass=1,distance=4,radius=0.1,from=-30"
    ) == ThrowRequest(1.0, 3.0, 1.0, "neck", "-30", 4.0, 0.1)
    box = parse_throw("mass=9 speed=2 at=1 target=neck shape=box size=0.3x0.6x.2 slide=true")
    assert (box.size, box.slide) == ((0.3, 0.6, 0.2), True)
    assert box.body(0.4).turn_xyzw == pytest.approx(rotations.about_z(0.4))
    cube = parse_throw("mass=4 speed=2 at=1 target=neck shape=box").body()
    assert cube.size == pytest.approx((0.2, 0.2, 0.2))  # 500 kg/m^3
    assert ThrowRequest(7.0, 1.0, 1.0, "neck").body().radius == natural_radius(7.0)


GOOD = ["mass=2", "speed=8", "at=0.9", "target=chest"]
WRONG: list[tuple[str, ...]] = [  # in place of the good ones, and parts of the error
    ("target=chset", "'chset'", "did you mean 'chest'?"),
    ("speed=0", "speed is 0; it must be above 0"),
    ("speed=1e-309", "speed is 1e-309 m/s; it must be 0.001 m/s or more"),
    ("distance=2e5", "distance is 200000 m", "from 1969.49 m at most"),
    ("distance=1e300", "distance is 1e+300 m", "at most"),
    ("speed=-3", "speed is -3"),
    ("mass=0", "mass is 0"),
    ("mass=1e9 radius=0.1", "mass is 1e+09; it must be 0.001 to 10000"),
    ("speed=5e3", "at most 1000 m/s"),
    ("at=0.1", "at is 0.1 s", "the ball needs", "let it hit later"),
    ("at=-1", "at is -1 s; it must be 0 s to less than 1 s"),
    ("at=1", "at is 1 s"),
    ("at=nan", "at is 'nan'"),
    ("from=below", "from is 'below'", "an angle in degrees, or one of front"),
    ("speed=fast", "speed is 'fast'; it must be a number"),
    ("velocity=3", "'velocity'", "speed"),
    ("hard", "'hard': write it as 'mass=2"),
    ("distance=0.1", "distance is 0.1 m", "nearer than the radius"),
    ("target=right_ankle", "in the ground", "'radius'"),
    ("shape=bax", "'bax'", "did you mean 'box'?"),
    ("size=1x1x1", "a ball has a 'radius'; 'size' and 'slide' are of shape=box"),
    ("shape=box radius=0.1", "a ball has a 'radius'"),
    ("shape=box size=1x1", "size is '1x1'; it must be three lengths in m, such as 0.3x0.5x0.2"),
    ("shape=box size=1x1xb", "size is 'b'"),
    ("shape=box size=0x1x1", "size_x is 0; it must be 0.01 to 10"),
    ("shape=box slide=yes", "slide is 'yes'; it must be true or false"),
    ("shape=box slide=true from=above target=right_ankle", "'above' cannot slide"),
    (
        "shape=box slide=true target=right_ankle size=0.1x0.5x0.5",
        *("a box of 0.1 x 0.5 x 0.5 m would tip over", "0.222 m high at most"),
    ),
    ("shape=box slide=true", "does not touch 'chest'", "'size'"),
    ("shape=box target=right_ankle", "in the ground", "slide=true"),
]


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong[0])
def test_a_throw_that_cannot_be_is_rejected_in_a_line(wrong: tuple[str, ...]) -> None:
    changed, *expected = wrong
    text = " ".join(part for part in GOOD if part.split("=")[0] + "=" not in changed)

    with pytest.raises(ConfigurationError) as caught:
        plan_throws(plan_of(), [f"{text} {changed}"])

    line = str(caught.value)
    assert "\n" not in line and line.startswith("throw '")
    assert all(part in line for part in expected), line


@pytest.mark.parametrize("key", ["mass", "speed", "at", "target"])
def test_what_a_throw_needs_is_named(key: str) -> None:
    rest = [part for part in GOOD if not part.startswith(f"{key}=")]

    with pytest.raises(ConfigurationError, match=f"'{key}' is missing; write it as"):
        parse_throw(" ".join(rest))
    with pytest.raises(ConfigurationError, match="'from' twice"):
        parse_throw("from=left from=right")


def test_no_more_balls_than_an_episode_may_have() -> None:
    with pytest.raises(ConfigurationError, match="at most 100"):
        plan_throws(plan_of(), ["mass=2 speed=8 at=0.9 target=chest"] * 101)


# A run


@dataclass(frozen=True)
class Made:
    """A run with throws over topics, and what it has left."""

    plan: RunPlan
    throws: list[PlannedThrow]
    directory: Path
    recording: Recording
    summary: dict[str, Any]


THROWN = [
    "mass=2 speed=8 at=0.5 from=front target=chest",
    "mass=3 speed=4 at=0.6 from=back target=root distance=1 shape=box size=0.2x0.3x0.1",
]


@pytest.fixture(scope="module")
def thrown(tmp_path_factory: pytest.TempPathFactory) -> Made:
    directory = tmp_path_factory.mktemp("thrown") / "run"
    plan = make_plan("humanoid", 0.75, WALK, {"ball_lifetime": 0.25}, {"behaviour": "reactive"})
    throws, _ = plan_throws(plan, THROWN)
    run_plan(plan, directory, inputs=PlannedInputs(throws=throws))
    summary, _ = read_metrics(directory)
    return Made(plan, throws, directory, read_recording(directory), summary)


@pytest.mark.slow
def test_the_bag_says_what_was_thrown_and_where_it_went(thrown: Made) -> None:
    recording, throws = thrown.recording, sorted(thrown.throws, key=lambda each: each.stamp_ns)

    ticks = [tick for tick, each in enumerate(recording.throws) if each]
    assert [recording.stamps_ns[tick] for tick in ticks] == [each.stamp_ns for each in throws]
    assert [recording.throws[tick] for tick in ticks] == [(each.throw,) for each in throws]
    assert recording.throws_sent == 2 and thrown.summary["rejected_throws"] == 0
    first, second = ticks
    there = [0 if balls is None else len(balls.names) for balls in recording.balls]
    assert there == [0] * (first + 1) + [1] * (second - first) + [2] * (181 - second - 1)
    gone = [balls is not None and bool(balls.motion[0, 0] > 5e3) for balls in recording.balls]
    assert gone == [row > first + 60 for row in range(181)] and gone[-1]


@pytest.mark.slow
def test_a_run_in_one_process_takes_the_same_throws(thrown: Made, tmp_path: Path) -> None:
    prepare_directory(tmp_path / "run", overwrite=False)

    run_in_process(thrown.plan, tmp_path / "run", inputs=PlannedInputs(throws=thrown.throws))

    summary, _ = read_metrics(tmp_path / "run")
    assert summary["state_hash"] == thrown.summary["state_hash"]


@pytest.mark.slow
def test_the_bag_says_whether_each_ball_hit_and_when(thrown: Made) -> None:
    states = read_states(thrown.directory)
    assert states is not None
    seen: States = []
    for _ in ticks_in_process(thrown.plan, (), thrown.throws, watch=partial(watch_states, seen)):
        pass

    words = describe_hits(thrown.plan, thrown.throws, states)

    (first, at), (second, later) = (re.findall(r"'(\w+)' at ([\d.]+) s", each)[0] for each in words)
    assert (first, second) == ("chest", "root")
    assert (float(at), float(later)) == pytest.approx((0.5, 0.6), abs=0.02)
    assert describe_hits(thrown.plan, thrown.throws, seen) == words
    before = round(0.4 * RATE)  # s: neither has come by then
    assert describe_hits(thrown.plan, thrown.throws, states[:before]) == ["missed", "missed"]
    assert "not known" in describe_hits(thrown.plan, thrown.throws, None)[0]


@pytest.mark.parametrize("aside", [0.0, 3.0])
def test_a_ball_that_bounces_on_the_ground_has_missed(aside: float) -> None:
    plan = plan_of(1.0)
    ball = ProjectileThrow(1.0, 0.1, (0.05, aside, 2.5), (0.0, 0.0, -2.0))
    throws, states = [PlannedThrow(CLOCK.stamp_ns(1), ball)], list[Any]()

    for _ in ticks_in_process(plan, (), throws, watch=partial(watch_states, states)):
        pass

    (words,) = describe_hits(plan, throws, states)
    assert words == "missed" if aside else words.startswith("hit ")


@pytest.mark.slow
def test_the_bag_says_what_the_controller_did_about_it(thrown: Made) -> None:
    changes, hit = thrown.recording.modes, CLOCK.stamp_ns(1 + round(0.5 * RATE))

    first, second, *_ = changes
    assert (first.stamp_ns, first.mode) == (thrown.recording.stamps_ns[0], "TRACK")
    assert second.mode == "REACT" and second.facts["link"] == "chest"
    assert 0 <= second.stamp_ns - hit <= 3 * 10**9 / RATE
    assert second.facts["impulse"] == pytest.approx(16.0, rel=0.2)


@pytest.mark.slow
def test_a_replay_through_topics_sends_the_balls_as_well(thrown: Made) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("ROS_DOMAIN_ID", raising=False)
        result = replay_commands(thrown.directory, progress=lambda _: None, tell=lambda _: None)

    assert result.identical and result.states == 181


@pytest.mark.slow
def test_a_replay_is_identical_with_all_the_balls(thrown: Made) -> None:
    result = replay([thrown.recording])

    assert result.identical and result.states == 181 and not result.remarks
    assert result.state_hashes == {"": thrown.summary["state_hash"]}


@pytest.mark.slow
def test_a_replay_sees_a_ball_that_is_missing_another_or_elsewhere(thrown: Made) -> None:
    recording = thrown.recording
    ticks = [tick for tick, each in enumerate(recording.throws) if each]
    one = recording.throws[ticks[0]][0]

    def changed(*throws: ProjectileThrow) -> Recording:
        rows = [*recording.throws]
        rows[ticks[0]] = throws
        return replace(recording, throws=tuple(rows))

    heavier = replay([changed(replace(one, mass=one.mass * (1.0 + 1e-12)))]).difference
    elsewhere = replay([changed(replace(one, radius=one.radius + 1e-9))]).difference
    x, y, z = one.position
    moved = replay([changed(replace(one, position=(x, y, np.nextafter(z, 9.0))))]).difference

    assert heavier is not None and heavier.quantity in ("position", "velocity", "ball")
    # No sooner than it hits; but MuJoCo turns a ball in flight by 1e-19 rad, by its inertia.
    assert heavier.tick > ticks[0] + (20 if DEFAULT_ENGINE == "bullet" else 0)
    assert elsewhere is not None
    assert moved is not None and moved.quantity == "ball" and moved.tick == ticks[0] + 2
    assert "'ball_1': z in m was" in str(moved)
    with pytest.raises(RecordingError, match="2 balls on 'thrown'"):
        replay([changed()])


@pytest.mark.slow
def test_a_recording_of_throws_alone_is_replayed_without_them_and_says_so(thrown: Made) -> None:
    silent = replace(thrown.recording, throws=(), balls=())

    result = replay([silent])

    assert any("'throw'" in note and "without balls" in note for note in result.remarks)
    assert not result.identical


@pytest.mark.slow
def test_without_a_bag_nobody_waits_for_a_recorder_of_pushes_and_throws(tmp_path: Path) -> None:
    directory = tmp_path / "run"
    plan = plan_of(0.25)
    throws, _ = plan_throws(plan, ["mass=1 speed=10 at=0.2 distance=1 target=neck radius=0.05"])
    pushes = [plan_push(plan, "chest", (10.0, 0.0, 0.0), 0.1)]

    run_plan(plan, directory, write_bag=False, inputs=PlannedInputs(pushes, throws))

    summary, _ = read_metrics(directory)
    assert summary["ticks"] == 60
    assert (summary["rejected_pushes"], summary["rejected_throws"]) == (0, 0)
    with_both = [tick.following for tick in ticks_in_process(plan, pushes, throws)]
    with_one = [tick.following for tick in ticks_in_process(plan, pushes)]
    assert not np.array_equal(with_both[-1].position, with_one[-1].position)  # it has hit
    run_in_process(plan, directory, inputs=PlannedInputs(pushes, throws))
    again, _ = read_metrics(directory)
    assert again["state_hash"] == summary["state_hash"]
