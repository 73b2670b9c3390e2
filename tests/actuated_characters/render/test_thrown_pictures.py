"""Balls in pictures and reports: where the recording has them, and what was done about them."""

from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.bags.recording import ModeChange, Recording
from actuated_characters.render.engine.renderer import Renderer
from actuated_characters.render.scene import make_scene
from actuated_characters.report.events import mode_events, throw_events
from lecture.framework.study import RunSpec
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Pose, Shape, ShapeType
from msgs_config.geometry import rotations
from msgs_config.geometry.rotations import IDENTITY_XYZW
from msgs_config.messages.projectiles import BallStates, ball_names, decode_balls, encode_balls
from msgs_config.messages.throw import ProjectileThrow
from tests.support.in_process import InProcessRunner
from tests.support.physics import character
from tests.support.pictures import take_picture, view_of

HUMANOID = character("humanoid")
REST = np.array(HUMANOID.rest_position)
SIZE = (160, 160)
ONE = ProjectileThrow(2.0, 0.1, (1.0, 0.0, 1.0), (-3.0, 0.0, 4.0))
OTHER = ProjectileThrow(3.0, 0.2, (0.0, 2.0, 1.0), (0.0, -1.0, 0.0))


BOX = ProjectileThrow(3.0, None, (0.0, 2.0, 1.0), (0.0, -1.0, 0.0), (0.6, 0.1, 0.2), 0.5)


def sphere_at(centre: FloatArray, radius: float) -> Shape:
    """A ball with its centre (3,) in the world, m."""
    return Shape(ShapeType.SPHERE, (radius,), Pose.of_arrays(centre, np.array(IDENTITY_XYZW)))


def balls_at(stamp_ns: int, *centres: tuple[float, float, float]) -> BallStates:
    rows = [(*centre, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6) for centre in centres]
    names = tuple(f"ball_{number + 1}" for number in range(len(rows)))
    return BallStates(stamp_ns, names, np.array(rows))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A recording of five ticks with a reset, in which three balls are thrown."""
    runner = InProcessRunner(tmp_path_factory.mktemp("runner"))
    case = RunSpec("one", "humanoid", 5.0 / 240.0, {"reference": "hold"}, {}, {})
    without_balls = runner.run(case).recording
    effort = without_balls.effort.copy()
    effort[2] = np.nan  # that tick is a reset
    stamps = without_balls.stamps_ns.tolist()
    return replace(
        without_balls,
        effort=effort,
        throws=((), (ONE,), (), (OTHER,), (ONE,)),
        balls=(
            None,
            None,
            balls_at(stamps[2], (1.0, 0.0, 1.0)),
            None,
            balls_at(stamps[4], (0.0, 2.0, 1.0)),
            balls_at(stamps[5], (0.0, 1.9, 1.0), (1.0, 0.0, 1.0)),
        ),
    )


def test_where_the_balls_are_is_read_as_it_was_written() -> None:
    rng = np.random.default_rng(1)
    balls = BallStates(12_500_000, ball_names([ONE, BOX, OTHER]), rng.normal(size=(3, 13)))

    found = decode_balls(encode_balls(balls))

    assert (found.stamp_ns, found.names) == (12_500_000, ("ball_1", "box_2", "ball_3"))
    assert found.motion.tobytes() == balls.motion.tobytes()


def test_a_scene_has_the_balls_of_each_state_with_their_radii(recording: Recording) -> None:
    scene = make_scene([recording])

    frames = scene.frames(np.arange(6), [""] * 6, ghosts=False)
    found = [[[*ball.pose.position, *ball.size] for ball in frame.balls] for frame in frames]

    assert found == [
        [],
        [],
        [[1.0, 0.0, 1.0, 0.1]],
        [],
        [[0.0, 2.0, 1.0, 0.2]],
        [[0.0, 1.9, 1.0, 0.2], [1.0, 0.0, 1.0, 0.1]],
    ]


def test_where_a_bag_begins_with_balls_the_throws_in_it_are_those_of_later_ones(
    recording: Recording,
) -> None:
    part = replace(recording.rows(slice(4, 6)), throws=((OTHER,),))

    shapes = make_scene([part]).ball_shapes(1, ("ball_1", "ball_2"))

    assert [shape.size for shape in shapes] == [(0.1,), (0.2,)]  # by default, and as it was thrown
    assert [event.text.split()[0] for event in throw_events(part)] == ["ball_2"]


def test_balls_that_are_told_of_late_are_those_that_were_thrown(recording: Recording) -> None:
    late = replace(recording, balls=(*[None] * 5, recording.balls[5]))

    shapes = make_scene([late]).ball_shapes(5, ("ball_1", "ball_2"))
    assert [shape.size for shape in shapes] == [(0.2,), (0.1,)]


@pytest.mark.parametrize("ground", [False, True])
def test_a_ball_is_seen_where_it_is_and_nowhere_else(ground: bool) -> None:
    camera = Renderer(HUMANOID, ground=ground)
    view = view_of(camera, REST, size=SIZE)
    # towards the camera: before the character
    ball = [sphere_at(view.target + 0.8 * view.axes()[2], 0.15)]

    empty = take_picture(camera, REST, view=view, size=SIZE)
    full = take_picture(camera, REST, view=view, size=SIZE, balls=ball)
    again = take_picture(camera, REST, view=view, size=SIZE)

    differs = (empty != full).any(axis=2)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    # a sphere's outline, seen from the distance d, has the slope r / sqrt(d^2 - r^2)
    d = view.distance - 0.8
    pixel = 2.0 * np.tan(0.5 * view.field_of_view) / SIZE[1]
    radius = 0.15 / np.sqrt(d**2 - 0.15**2) / pixel
    away = np.hypot(rows + 0.5 - 0.5 * SIZE[1], columns + 0.5 - 0.5 * SIZE[0])
    assert differs[away < radius - 1.5].all()
    if not ground:  # where it keeps no light off
        assert not differs[away > radius + 1.5].any()
    assert np.array_equal(again, empty)


def test_a_box_is_seen_turned_as_it_is() -> None:
    camera = Renderer(HUMANOID, ground=False)
    view = replace(view_of(camera, REST, size=SIZE), pitch=0.0)
    right, _, back = view.axes()
    turn = rotations.about_z(float(np.arctan2(right[1], right[0])))
    pose = Pose.of_arrays(view.target + 0.8 * back, turn)  # towards the camera, and turned to it
    box = Shape(ShapeType.BOX, (0.5, 0.01, 0.2), pose)

    empty = take_picture(camera, REST, view=view, size=SIZE)
    full = take_picture(camera, REST, view=view, size=SIZE, balls=[box])

    differs = (empty != full).any(axis=2)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    pixel = 2.0 * np.tan(0.5 * view.field_of_view) / SIZE[1] * (view.distance - 0.8)
    across = pixel * np.abs(columns + 0.5 - 0.5 * SIZE[0])
    along = pixel * np.abs(rows + 0.5 - 0.5 * SIZE[1])
    slack = 2.0 * pixel
    assert differs[(across < 0.25 - slack) & (along < 0.1 - slack)].all()
    assert not differs[(across > 0.25 + slack) | (along > 0.1 + slack)].any()


def test_a_ball_behind_the_character_is_hidden() -> None:
    camera = Renderer(HUMANOID, ground=False)
    view = view_of(camera, REST, size=SIZE)
    behind = [sphere_at(view.target - 1.0 * view.axes()[2] + (0.0, 0.0, 0.1), 0.02)]

    empty = take_picture(camera, REST, view=view, size=SIZE)
    full = take_picture(camera, REST, view=view, size=SIZE, balls=behind)

    assert np.array_equal(empty, full)


# What a report says


def test_each_ball_is_told_when_it_was_let_go(recording: Recording) -> None:
    events = throw_events(recording)

    assert [(event.text.split()[0], event.start) for event in events] == [
        ("ball_1", pytest.approx(1 / 240.0)),
        ("ball_1", pytest.approx(3 / 240.0)),  # of the next episode
        ("ball_2", pytest.approx(4 / 240.0)),
    ]
    assert events[0].text == "ball_1 thrown: 2 kg, radius 0.1 m, 5 m/s"


def test_a_mode_lasts_until_the_next_one_or_the_end(recording: Recording) -> None:
    stamps = recording.stamps_ns.tolist()
    changes = (
        ModeChange(stamps[0], "TRACK", {}),
        ModeChange(stamps[1], "REACT", {"link": "chest", "impulse": 19.79123}),
        ModeChange(stamps[4], "LIMP", {}),
    )

    events = mode_events(replace(recording, modes=changes))

    tick = pytest.approx
    assert [(event.label, event.start, event.duration) for event in events] == [
        ("TRACK", 0.0, tick(1 / 240.0, abs=1e-8)),
        ("REACT", tick(1 / 240.0, abs=1e-8), tick(3 / 240.0, abs=1e-8)),
        ("LIMP", tick(4 / 240.0, abs=1e-8), tick(1 / 240.0, abs=1e-8)),
    ]
    assert events[1].text == "REACT for 0.0125 s: link chest, impulse 19.79"
    assert mode_events(replace(recording, modes=())) == []
