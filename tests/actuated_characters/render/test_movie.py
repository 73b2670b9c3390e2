"""Films of recorded runs: which states they show, from where, and what is marked in them."""

import multiprocessing
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest

from actuated_characters.bags.node_parameters import NodeParameters
from actuated_characters.bags.recording import RecordedWorld, Recording
from actuated_characters.render.captions import write_on
from actuated_characters.render.drawing import SceneSettings, draw
from actuated_characters.render.engine.renderer import FrameSpec, Picture
from actuated_characters.render.movie import (
    GhostPlace,
    Movie,
    MovieSettings,
    camera_path,
    caption,
    picture_rows,
)
from actuated_characters.render.scene import make_scene
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Character, Placement, UrdfOptions
from msgs_config.clips.nearest_rows import nearest_rows
from msgs_config.errors import CharacterError, ConfigurationError, RecordingError, RunError
from msgs_config.messages.wrenches import WrenchArrays
from tests.support.physics import DATA, character

pytestmark = pytest.mark.slow

RATE = 240
SIZE = (96, 64)
BOX = str(DATA / "free_box.yaml")
HERE = MovieSettings(skinned=False, size=SIZE, workers=1)


def recorded(
    whole: Character, position: FloatArray, reference: FloatArray | None = None
) -> Recording:
    """What a bag would say of these positions (t + 1, n), one a tick."""
    count, size = position.shape
    nothing = np.full_like(position, np.nan)
    return Recording(
        character=whole,
        parameters={"rate": RATE},
        stamps_ns=np.round(np.arange(1, count + 1) * (1e9 / RATE)).astype(np.intp),
        published_ns=np.arange(count),
        position=position,
        velocity=np.zeros_like(position),
        effort=np.zeros((count - 1, size)),
        reference_position=nothing if reference is None else reference,
        reference_velocity=nothing,
        contacts=(),
        applied_wrench=(),
        commands=((),) * count,
    )


def standing(name: str = "humanoid", ticks: int = 60, speed: float = 0.0) -> Recording:
    """A character in its rest pose, moved along x in m/s, and a reference that does the same."""
    whole = character(name)
    position = np.tile(whole.rest_position, (ticks + 1, 1))
    position[:, 0] += speed * np.arange(ticks + 1) / RATE
    return recorded(whole, position, position.copy())


def drawn(recordings: Recording | Sequence[Recording], settings: MovieSettings) -> list[Picture]:
    several = [recordings] if isinstance(recordings, Recording) else recordings
    return list(Movie(several, settings).pictures())


def is_ghost(picture: Picture) -> BoolArray:
    """Where a picture is as green as only a ghost makes it."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    greener: BoolArray = green - np.maximum(red, blue) > 12
    return greener


def is_body(picture: Picture) -> BoolArray:
    """Where it has a colour that neither ghost nor ground nor a caption has."""
    spread = np.ptp(picture.astype(int), axis=2)
    coloured: BoolArray = (spread > 40) & ~is_ghost(picture)
    return coloured


def middle(mask: BoolArray) -> FloatArray:
    """Mean row and column."""
    mean: FloatArray = np.argwhere(mask).mean(axis=0)
    return mean


# Which states


def test_pictures_show_the_states_nearest_to_evenly_spaced_times() -> None:
    times = np.arange(241) / 240.0

    np.testing.assert_array_equal(picture_rows(times, MovieSettings(fps=30)), np.arange(0, 241, 8))
    quarter = picture_rows(times, MovieSettings(fps=30, speed=0.25, start=0.5, end=0.6))
    np.testing.assert_array_equal(quarter, np.arange(120, 145, 2))
    odd = picture_rows(times, MovieSettings(fps=50))
    np.testing.assert_array_equal(odd, np.floor(np.arange(51) * 4.8 + 0.5))
    slow = picture_rows(times, MovieSettings(fps=30, speed=0.0625, end=0.01))
    np.testing.assert_array_equal(slow, [0, 0, 1, 1, 2])  # a tie is the earlier one's


def test_the_nearest_state_is_the_nearest_of_all() -> None:
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.001, 0.1, 200))
    wanted = rng.uniform(times[0], times[-1], 500)

    rows = nearest_rows(times, wanted)

    np.testing.assert_array_equal(rows, np.abs(times[:, np.newaxis] - wanted).argmin(axis=0))
    np.testing.assert_array_equal(nearest_rows(np.zeros(1), np.zeros(3)), [0, 0, 0])


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"start": 0.3}, "from 0.3 s to 0.25 s is not in the recording: 0 to 0.25 s"),
        ({"start": -1.0}, "from -1 s"),
        ({"end": 0.26}, "to 0.26 s is not in"),
        ({"end": float("nan")}, "to nan s is not in"),
        ({"start": 0.2, "end": 0.1}, "from 0.2 s to 0.1 s"),
        ({"speed": 0.0}, "at speed 0; both must be positive"),
        ({"speed": float("inf")}, "at speed inf"),
        ({"fps": 0}, "0 pictures a second"),
        ({"speed": 1e-9}, "it must be 100000 or fewer"),
        ({"size": (8, 64)}, "16x16 to 4096x4096"),
    ],
)
def test_what_cannot_be_filmed_is_refused(wrong: dict[str, object], says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        Movie([standing()], replace(HERE, **wrong))  # type: ignore[arg-type]


# From where


def test_the_camera_goes_with_the_character_and_the_ground_goes_by() -> None:
    pictures = drawn(standing(speed=2.0), replace(HERE, ghost=GhostPlace.NONE, end=0.2))

    middles = np.array([middle(is_body(picture)) for picture in pictures])
    np.testing.assert_allclose(middles, np.tile(middles[0], (len(middles), 1)), atol=0.7)
    changed = (np.abs(pictures[-1].astype(int) - pictures[0]).max(axis=2) > 15)[20:]
    assert changed.mean() > 0.1


def test_a_reset_is_a_cut() -> None:
    recording = standing(ticks=60)
    position, effort = recording.position.copy(), recording.effort.copy()
    position[31:, 0] += 50.0
    effort[30] = np.nan
    jumped = replace(recording, position=position, effort=effort, reference_position=position)

    path = camera_path(make_scene([jumped]))
    before, after = drawn(jumped, replace(HERE, ghost=GhostPlace.NONE, fps=4))

    np.testing.assert_allclose(path[:, 0], position[:, 0], atol=1e-9)
    np.testing.assert_allclose(middle(is_body(before)), middle(is_body(after)), atol=0.7)


def test_the_camera_of_an_arm_rests() -> None:
    arm = character("franka_panda")
    rest = np.tile(arm.rest_position, (20, 1))
    rest[:, 0] += np.linspace(0.0, 0.5, 20)

    assert not camera_path(make_scene([recorded(arm, rest)])).any()


# The ghost


def test_a_ghost_beside_is_seen_whole_and_does_not_hide_the_character() -> None:
    recording = standing(ticks=1)
    picture = {
        place: drawn(recording, replace(HERE, ghost=place, size=(160, 120)))[0]
        for place in (None, GhostPlace.BESIDE, GhostPlace.NONE)
    }

    np.testing.assert_array_equal(picture[None], picture[GhostPlace.BESIDE])
    beside = picture[GhostPlace.BESIDE]
    ghost, body = is_ghost(beside), is_body(beside)
    ghost_columns, body_columns = np.flatnonzero(ghost.any(axis=0)), np.flatnonzero(body.any(0))
    assert body_columns[0] > 0 and body_columns[-1] < ghost_columns[0]
    assert ghost_columns[-1] < 159
    # as tall as the character, but for what is farther away
    assert 0.7 < np.ptp(np.flatnonzero(ghost.any(1))) / np.ptp(np.flatnonzero(body.any(1))) < 1.0
    assert not is_ghost(picture[GhostPlace.NONE]).any()


def test_a_ghost_over_is_where_the_reference_really_is() -> None:
    recording = standing(BOX, ticks=1)
    reference = recording.reference_position.copy()
    reference[:, 2] += 1.0

    (picture, _) = drawn(
        replace(recording, reference_position=reference),
        replace(HERE, ghost=GhostPlace.OVER, fps=RATE),
    )

    # above it, in the same column
    ghost = middle(is_ghost(picture))
    assert ghost[0] < 0.5 * SIZE[1]
    assert ghost[1] == pytest.approx(0.5 * SIZE[0], abs=2.0)


def test_a_reference_far_away_does_not_make_the_character_small() -> None:
    recording = standing(ticks=8)
    reference = recording.reference_position.copy()
    reference[4:, 0] += 100.0
    settings = replace(HERE, fps=RATE)

    near, far = (
        drawn(replace(recording, reference_position=each), settings)[0]
        for each in (recording.reference_position, reference)
    )

    np.testing.assert_array_equal(near, far)


def test_without_a_reference_there_is_no_ghost_and_none_may_be_asked_for() -> None:
    recording = standing(ticks=1)
    alone = replace(recording, reference_position=np.full_like(recording.position, np.nan))

    assert not is_ghost(drawn(alone, HERE)[0]).any()
    with pytest.raises(RecordingError, match="no reference"):
        Movie([alone], replace(HERE, ghost=GhostPlace.BESIDE))


# Marks and captions


def arrows(
    recording: Recording, pushes: Sequence[WrenchArrays | None]
) -> tuple[Picture, list[BoolArray]]:
    """The first picture, and what is otherwise in the others, when each tick has such a push."""
    settings = replace(HERE, ghost=GhostPlace.NONE, size=(160, 120))
    first, *others = drawn(replace(recording, applied_wrench=tuple(pushes)), settings)
    seen = [(picture != first).any(axis=2) for picture in others]
    for mask in seen:
        mask[:24, :60] = False  # where the caption is
    return first, seen


def push(*force: float) -> WrenchArrays:
    return WrenchArrays.of_rows(0, ["neck"], [(*force, 0.0, 0.0, 0.0)], [])


def test_a_push_is_an_arrow_from_where_it_comes_in_the_first_picture_after_it() -> None:
    recording = standing(ticks=24)

    picture, seen = arrows(recording, [push(9.0, 0.0, 0.0) if k == 10 else None for k in range(24)])

    # pictures are of states 0, 8, 16, 24; tick 10 leads to state 11
    assert [bool(mask.any()) for mask in seen] == [False, True, False]
    body = np.argwhere(is_body(picture))
    head = body[body[:, 0] < body[:, 0].min() + 10].mean(axis=0)
    row, column = middle(seen[1])
    assert row == pytest.approx(head[0], abs=10.0)
    assert column < head[1] - 8.0  # it pushes to the right, and so it is on the left


def test_the_strongest_push_of_a_link_is_drawn_and_its_length_says_how_strong() -> None:
    forces = [1.0, 10.0, 1.0, 0.0, *[0.0] * 4, *[2.0] * 8]

    # from above: then no arrow may leave the picture
    _, (strong, weak) = arrows(standing(ticks=16), [push(0.0, 0.0, -newton) for newton in forces])

    lengths = [np.ptp(np.flatnonzero(mask.any(axis=1))) for mask in (strong, weak)]
    # a quarter of the strongest at least, and a fifth of the rest
    assert lengths[0] > 20
    assert lengths[1] / lengths[0] == pytest.approx(0.25 + 0.2 * 0.75, abs=0.12)


def test_links_that_touch_something_are_marked() -> None:
    recording = standing(ticks=16)
    touch = WrenchArrays.of_rows(0, ["left_ankle"], [(0.0,) * 6], [])
    touched = replace(recording, contacts=(*[None] * 8, *[touch] * 8))
    settings = replace(HERE, ghost=GhostPlace.NONE, contacts=True)

    without_contacts = drawn(touched, replace(settings, contacts=False))
    marked = drawn(touched, settings)

    np.testing.assert_array_equal(marked[1], without_contacts[1])  # of state 8, before the touch
    changed = np.argwhere((marked[2] != without_contacts[2]).any(axis=2))
    assert len(changed) > 3 and changed[:, 0].min() > 0.6 * SIZE[1]
    with pytest.raises(RecordingError, match="no contacts"):
        Movie([recording], settings)


def test_a_caption_says_when_it_is_and_what_is_in_force() -> None:
    recording = standing(ticks=60)
    effort = recording.effort.copy()
    effort[49] = np.nan
    changed = NodeParameters({"law": "pd"}, int(recording.stamps_ns[24]))
    first = NodeParameters({"law": "stable_pd"}, None)
    scene = make_scene(
        [
            replace(
                recording,
                effort=effort,
                controller=(first, changed),
                parameters={"rate": RATE, "mode": "realtime"},
            )
        ]
    )

    assert caption(scene, 24) == "0.10 s   stable_pd   real time   episode 1"
    assert caption(scene, 25, 0.5) == "0.10 s   speed 0.5   pd   real time   episode 1"
    assert caption(scene, 50).endswith("episode 2")
    assert caption(make_scene([recording]), 0) == "0.00 s"
    first_picture, second_picture = drawn(recording, replace(HERE, end=0.04, ghost=GhostPlace.NONE))
    dark = [picture[:18].max(axis=2) < 100 for picture in (first_picture, second_picture)]
    assert dark[0].any() and (dark[0] != dark[1]).any()


# Several characters


def test_all_characters_of_a_world_are_in_the_picture() -> None:
    left = standing(ticks=16)
    whole = character("humanoid").placed(Placement(y=-1.5))
    position = np.tile(whole.rest_position, (11, 1))
    right = replace(
        recorded(whole, position, position),
        name="right",
        stamps_ns=left.stamps_ns[4:15],
    )

    scene = make_scene([replace(left, name="left"), right])
    both = drawn(scene.recordings, replace(HERE, ghost=GhostPlace.NONE))[0]
    alone = drawn(left, replace(HERE, ghost=GhostPlace.NONE))[0]

    # those ticks that there are of both
    np.testing.assert_array_equal(scene.recordings[0].stamps_ns, right.stamps_ns)
    assert scene.position.shape == (11, 2 * left.layout.size)
    columns = np.flatnonzero(is_body(both).any(axis=0))
    assert np.diff(columns).max() > 5  # a gap between them
    assert np.diff(np.flatnonzero(is_body(alone).any(axis=0))).max() <= 5


def test_characters_of_several_worlds_or_times_are_not_one_scene() -> None:
    here = standing(ticks=4)
    elsewhere = replace(here, name="b/x", world=RecordedWorld(namespace="b"))
    later = replace(here, stamps_ns=here.stamps_ns + 10**12)

    with pytest.raises(RecordingError, match="several worlds"):
        make_scene([here, elsewhere])
    with pytest.raises(RecordingError, match="no tick that all its characters have"):
        make_scene([here, later])


# Processes, and the file


def test_several_processes_draw_the_same_pictures_and_end(tmp_path: Path) -> None:
    recording = standing("lift", ticks=24)
    settings = replace(HERE, fps=60, workers=3)

    alone = drawn(recording, replace(settings, workers=1))
    several = drawn(recording, settings)

    assert len(alone) == 7
    np.testing.assert_array_equal(several, alone)
    assert not multiprocessing.active_children()


def test_a_film_that_is_left_ends_its_processes() -> None:
    pictures = Movie([standing("lift")], replace(HERE, fps=60, workers=2)).pictures()
    next(pictures)
    assert len(multiprocessing.active_children()) == 2

    pictures.close()

    assert not multiprocessing.active_children()


def test_a_process_that_dies_is_one_line() -> None:
    # long enough that no process can have drawn its part before it dies
    pictures = Movie([standing("lift", 4800)], replace(HERE, fps=60, workers=2)).pictures()
    next(pictures)
    multiprocessing.active_children()[0].kill()

    with pytest.raises(RunError, match="a process that draws"):
        list(pictures)

    assert not multiprocessing.active_children()


def test_an_error_in_a_process_is_that_of_one_process() -> None:
    lift = character("lift")
    nowhere = UrdfOptions(lift.loading.urdf_path, "<robot name='x'/>")
    settings = SceneSettings((lift,), True, nowhere, SIZE, write_on)
    frames = [FrameSpec(np.array(lift.rest_position))] * 3

    for workers in (1, 2):
        with pytest.raises(CharacterError, match="not a usable URDF"):
            list(draw(settings, frames, workers))


def test_a_film_is_saved_with_every_picture(tmp_path: Path) -> None:
    told: list[int] = []
    movie = Movie([standing("lift", ticks=24)], replace(HERE, fps=60))

    movie.save(tmp_path / "lift.mp4", told.append)

    assert told == list(range(1, len(movie) + 1))
    with av.open(str(tmp_path / "lift.mp4")) as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
        assert video.streams.video[0].average_rate == 60
    for frame, picture in zip(frames, movie.pictures(), strict=True):
        assert np.abs(frame.astype(int) - picture).mean() < 5.0
