"""Pictures of recorded runs, as functions and on the command line."""

import signal
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from matplotlib.image import imread
from PIL import Image, ImageSequence

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.cli import main
from actuated_characters.render.engine.renderer import Picture, Renderer
from actuated_characters.render.movie import Movie, MovieSettings
from actuated_characters.render.stills import pose_strip, save_png, strip
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.messages.wrenches import WrenchArrays
from tests.support.bags import Made, make_run, raw_configuration, raw_states, write_bag
from tests.support.physics import character
from tests.support.pictures import followed, is_green, take_picture, view_of
from tests.support.ros import Processes, wait_until

SIZE = (60, 80)
WALK = {"reference": "clip", "clip": "walk"}
GAP = 3  # white pixels between pictures


@pytest.fixture(scope="module")
def walk() -> Made:
    return make_run("humanoid", 0.25, WALK)


@pytest.fixture(scope="module")
def run(walk: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a run."""
    directory = tmp_path_factory.mktemp("walk")
    write_bag(directory / "bag", walk.messages())
    return directory


@pytest.fixture(scope="module")
def recording(run: Path) -> Recording:
    return read_recording(run)


def tiles(whole: Picture, columns: int) -> list[Picture]:
    """The pictures of a strip without captions, row by row."""
    width, height = SIZE
    rows = (len(whole) + GAP) // (height + GAP)
    return [
        whole[row * (height + GAP) :, column * (width + GAP) :][:height, :width]
        for row in range(rows)
        for column in range(columns)
    ]


def arrow_pixels(picture: Picture) -> int:
    """How many are redder than what arrows do not cover."""
    red, green, blue = np.moveaxis(picture.astype(float), -1, 0)
    return int((red > 2.8 * np.maximum(green, blue)).sum())


# Strips and single pictures


def test_a_strip_has_the_states_nearest_to_the_times(recording: Recording, walk: Made) -> None:
    whole = strip(recording, [0.0, 10.4 / 240.0, 0.25], labels=False, size=SIZE)

    positions = np.stack([walk.states[row].position for row in (0, 10, 60)])
    assert whole.shape == (80, 3 * 60 + 2 * GAP, 3)
    camera = Renderer(walk.plan.character, skinned=True)
    view = view_of(camera, positions, size=SIZE)
    for position, tile in zip(positions, tiles(whole, 3), strict=True):
        own = followed(camera, view, positions[0], position)
        np.testing.assert_array_equal(tile, take_picture(camera, position, view=own, size=SIZE))


def test_a_number_of_pictures_goes_evenly_from_the_first_state_to_the_last(
    recording: Recording,
) -> None:
    told: list[int] = []
    by_count = strip(recording, 3, size=SIZE, progress=told.append)

    assert told == [1, 2, 3]

    np.testing.assert_array_equal(by_count, strip(recording, [0.0, 0.125, 0.25], size=SIZE))
    # captions: more rows, and no two pictures under the same time
    assert by_count.shape[0] > SIZE[1]
    line = by_count[: by_count.shape[0] - SIZE[1]]
    width = SIZE[0]
    captions = [line[:, n * (width + GAP) :][:, :width] for n in range(3)]
    assert all((caption < 128).any() for caption in captions)
    assert (captions[0] != captions[1]).any() and (captions[1] != captions[2]).any()


def test_pictures_go_into_rows_and_what_is_left_is_white(recording: Recording) -> None:
    whole = strip(recording, 5, columns=2, labels=False, size=SIZE)

    assert whole.shape == (3 * 80 + 2 * GAP, 2 * 60 + GAP, 3)
    *pictures, empty = tiles(whole, 2)
    assert (empty == 255).all()
    in_a_row = tiles(strip(recording, 5, labels=False, size=SIZE), 5)
    for one, other in zip(pictures, in_a_row, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_ghost_is_drawn_where_there_is_a_reference_alone(recording: Recording) -> None:
    # nobody answers the last state, so that it has none
    times = [0.2, 0.25]
    alone, haunted = (
        tiles(strip(recording, times, labels=False, size=SIZE, ghost=ghost), 2)
        for ghost in (False, True)
    )

    assert (alone[0] != haunted[0]).any()
    assert is_green(haunted[0], 20).sum() > 10
    assert not is_green(haunted[1], 20).any()


def test_a_part_of_a_run_has_its_own_pictures(recording: Recording) -> None:
    part = strip(recording, 3, start=0.1, end=0.2, size=SIZE)

    np.testing.assert_array_equal(part, strip(recording, [0.1, 0.15, 0.2], size=SIZE))


def pushed(recording: Recording, *ticks: int) -> Recording:
    """The recording with a push to the left in some of its 60 ticks."""
    push = WrenchArrays.of_rows(0, ["root"], [(0.0, 90.0, 0.0, 0.0, 0.0, 0.0)], [])
    return replace(
        recording, applied_wrench=tuple(push if tick in ticks else None for tick in range(60))
    )


def test_a_push_between_two_stills_is_seen_while_it_acts(recording: Recording) -> None:
    short = pushed(recording, *range(36, 41))  # from 0.15 s to 41 / 240 s; stills 0.125 s apart

    seen = strip(short, 3, size=SIZE)

    # the still in the middle is the one that is moved: the state 39 in the middle of the push
    expected = strip(short, [0.0, 39.0 / 240.0, 0.25], size=SIZE)
    np.testing.assert_array_equal(seen, expected)
    caption = seen.shape[0] - SIZE[1]
    pictures = tiles(seen[caption:], 3)
    assert [bool(arrow_pixels(each) > 10) for each in pictures] == [False, True, False]


def test_a_still_in_a_push_stays_where_it_is(recording: Recording) -> None:
    long = pushed(recording, *range(20, 40))

    pictures = tiles(strip(long, 3, labels=False, size=SIZE), 3)

    alike = tiles(strip(long, [0.0, 0.125, 0.25], labels=False, size=SIZE), 3)
    np.testing.assert_array_equal(pictures, alike)
    assert [bool(arrow_pixels(each) > 10) for each in pictures] == [False, True, False]


def test_at_given_times_a_push_is_in_the_nearest_still_which_says_when_it_acted(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    short, told = pushed(recording, 27), list[str]()
    monkeypatch.setattr(
        "actuated_characters.render.stills.captioned",
        lambda picture, caption: (told.append(caption), picture)[1],
    )

    pictures = tiles(strip(short, [0.1, 0.15, 0.2], size=SIZE), 3)

    assert told == ["0.10 s, push 0.11 s", "0.15 s", "0.20 s"]
    assert [bool(arrow_pixels(each) > 10) for each in pictures] == [True, False, False]
    still = strip(short, [28.0 / 240.0], labels=False, size=SIZE)
    assert arrow_pixels(still) > 10  # that tick led to it
    later = {"start": 0.15, "labels": False, "size": SIZE}
    np.testing.assert_array_equal(strip(short, 2, **later), strip(recording, 2, **later))


def test_poses_have_one_scale_and_their_captions(walk: Made) -> None:
    rest = np.array(walk.plan.character.rest_position)
    lying = rest.copy()
    lying[2:6] = (0.2, 0.0, 0.0, 0.0)  # on its back: y-up in a z-up world

    whole = pose_strip(walk.plan.character, np.stack((rest, lying)), ["stands", "lies"])

    width = (whole.shape[1] - GAP) // 2
    # what suits both is neither as narrow as the one nor as flat as the other
    assert whole.shape[0] > 400 and 200 < width < 640


def test_the_world_of_the_run_is_drawn(tmp_path: Path, walk: Made) -> None:
    floating = make_run("humanoid", 0.01, WALK, terrain="none")
    in_space, on_ground = (
        strip(
            read_recording(write_bag(tmp_path / name, made.messages())),
            [0.0],
            labels=False,
            size=SIZE,
        )
        for name, made in (("none", floating), ("plane", walk))
    )

    np.testing.assert_array_equal(in_space[-1, 0], in_space[0, 0])
    assert (on_ground[-1, 0] != on_ground[0, 0]).any()


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"times": [0.0, 0.26]}, "time 0.26 s is not in the recording: 0 to 0.25 s"),
        ({"times": [-0.1]}, "time -0.1 s is not in the recording"),
        ({"times": [float("nan")]}, "time nan s"),
        ({"times": 0}, "0 pictures"),
        ({"times": []}, "0 pictures"),
        ({"times": 2, "columns": 0}, "rows of 0"),
        ({"times": 1, "size": (15, 100)}, "16x16 to 4096x4096"),
        ({"times": 1, "size": (100, 4097)}, "16x16 to 4096x4096"),
        ({"times": 1000, "size": (4096, 4096)}, "fewer or smaller"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    recording: Recording, wrong: dict[str, object], says: str
) -> None:
    with pytest.raises(ConfigurationError, match=says):
        strip(recording, **wrong)  # type: ignore[arg-type]


def test_captions_that_do_not_fit_are_refused() -> None:
    pendulum = character("pendulum")

    with pytest.raises(ConfigurationError, match="1 captions for 2 pictures"):
        pose_strip(pendulum, np.zeros((2, 1)), ["one"], size=SIZE)


def test_a_ghost_of_nothing_is_refused(walk: Made, tmp_path: Path) -> None:
    messages = [raw_configuration(walk.plan), *raw_states(walk.plan, walk.states)]
    recording = read_recording(write_bag(tmp_path / "bag", messages))

    with pytest.raises(RecordingError, match="no reference"):
        strip(recording, 1, ghost=True, size=SIZE)


def test_a_png_file_has_the_picture_to_the_bit(tmp_path: Path) -> None:
    picture = np.random.default_rng(1).integers(0, 256, (20, 30, 3)).astype(np.uint8)

    save_png(picture, tmp_path / "picture.png")

    read = np.rint(255.0 * imread(tmp_path / "picture.png"))[..., :3]
    np.testing.assert_array_equal(read, picture)


# The command line


def test_render_writes_a_strip_into_the_runs_directory(
    run: Path, own_handlers: None, capsys: pytest.CaptureFixture[str], recording: Recording
) -> None:
    assert (
        main(
            ["render", str(run), "--from", "0.05", "--count", "2", "--reference", "--size", "60x80"]
        )
        == 0
    )

    assert capsys.readouterr().out.strip() == str(run / "strip.png")
    read = np.rint(255.0 * imread(run / "strip.png"))[..., :3]
    np.testing.assert_array_equal(read, strip(recording, 2, start=0.05, ghost=True, size=SIZE))


@pytest.mark.slow
def test_a_real_run_is_drawn_and_can_be_run_again(
    processes: Processes, tmp_path: Path, own_handlers: None
) -> None:
    run = ("run", "--in-process", "--character", "lift", "--duration", "0.1")
    run = (*run, "--output", str(tmp_path / "run"))
    assert main([*run]) == 0

    render = processes.command("render", str(tmp_path / "run"), "--times", "0,0.05")
    assert render.wait() == 0
    assert "2/2 pictures" in render.stderr

    picture = imread(tmp_path / "run" / "strip.png")
    assert picture.shape[0] > 400 and picture.shape[1] % 2 == GAP % 2  # two, with captions
    assert main([*run, "--overwrite"]) == 0
    assert not (tmp_path / "run" / "strip.png").exists()


def test_render_writes_a_film_into_the_runs_directory(
    run: Path, own_handlers: None, capsys: pytest.CaptureFixture[str], recording: Recording
) -> None:
    film = ["--video", "--size", "96x64", "--fps", "20", "--from", "0.1", "--workers", "1"]

    assert main(["render", str(run), *film]) == 0

    assert capsys.readouterr().out.strip() == str(run / "video.mp4")
    movie = Movie([recording], MovieSettings(fps=20, start=0.1, size=(96, 64), workers=1))
    with av.open(str(run / "video.mp4")) as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(frames) == 4
    for frame, picture in zip(frames, movie.pictures(), strict=True):
        assert np.abs(frame.astype(int) - picture).mean() < 5.0
    assert is_green(frames[0], 20).sum() > 10
    (run / "video.mp4").unlink()


def test_render_writes_an_animation_for_pages(
    run: Path, own_handlers: None, recording: Recording, tmp_path: Path
) -> None:
    file = tmp_path / "film.webp"
    film = ["--size", "97x65", "--fps", "30", "--from", "0.1", "--workers", "1"]

    assert main(["render", str(run), "--output", str(file), *film]) == 0

    pictures = Movie([recording], MovieSettings(30, start=0.1, size=(97, 65), workers=1)).pictures()
    with Image.open(file) as opened:
        frames, ends = [], []
        for frame in ImageSequence.Iterator(opened):
            frames.append(np.asarray(frame.convert("RGB")).astype(int))
            ends.append(frame.info["timestamp"] + frame.info["duration"])
    assert ends == [33, 67, 100, 133, 167]  # ms: 30 a second in the long run
    for frame, picture in zip(frames, pictures, strict=True):
        assert np.abs(frame - picture).mean() < 8.0


def test_an_animation_that_would_not_fit_into_memory_is_refused(
    recording: Recording, tmp_path: Path
) -> None:
    movie = Movie([recording], MovieSettings(fps=100, speed=0.01, size=(1920, 1080)))

    with pytest.raises(ConfigurationError, match=r"a \.webp may have 172: .*\.mp4"):
        movie.save(tmp_path / "film.webp")

    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGINT, marks=pytest.mark.nightly), signal.SIGKILL]
)
def test_a_movie_that_is_interrupted_or_killed_leaves_no_process(
    run: Path, processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    folder = tmp_path / "movie"
    folder.mkdir()
    slow = ("--speed", "0.001", "--size", "96x64", "--workers", "2")
    process = processes.command("render", str(run), "--output", str(folder / "movie.mp4"), *slow)
    wait_until(lambda: any(folder.iterdir()), "a movie that is being written")
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()

    process.send(number)

    code = process.wait(20.0)
    if number is signal.SIGINT:
        assert code == 130
        assert process.stderr.splitlines()[-1] == "interrupted"
        assert "Traceback" not in process.stderr
        assert not list(folder.iterdir())
    assert len(children) >= 2
    wait_until(lambda: not any(Path(f"/proc/{child}").exists() for child in children), "their end")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--times", "0,9"], "time 9 s is not in the recording: 0 to 0.25 s"),
        (["--times", "0;1"], "write numbers with commas"),
        (["--count", "0"], "0 pictures; it must be 1 or more"),
        (["--size", "640"], "write it as WxH"),
        (["--size", "8x8"], "size 8x8 is not sensible"),
        (["--size", "9999x9999"], "size 9999x9999 is not sensible"),
        (["--columns", "0"], "rows of 0"),
        (["--output", "picture.jpg"], "must be a .png file"),
        (["--output", "no/such/folder/picture.png"], "its directory does not exist"),
        (["--video", "--count", "3"], "--count is a strip's, and this is a movie"),
        (["--output", "x.mp4", "--times", "0"], "--times is a strip's"),
        (["--fps", "10"], "--fps is a movie's; add --video"),
        (["--from", "0.3"], "from 0.3 s to 0.25 s is not in the recording"),
        (["--from", "0.1", "--times", "0"], "--times and --from: give one of the two"),
        (["--contacts"], "--contacts is a movie's"),
        (["--ghost", "beside"], "a strip has it over, or none"),
        (["--times", "0", "--count", "1"], "give one of the two"),
        (["--reference", "--ghost", "none"], "--reference is --ghost over; --ghost is none"),
        (["--video", "--output", "x.png"], "must be a .mp4 or .webp file"),
        (["--output", "x.webp", "--fps", "101"], "101 frames a second; it must be 1 to 100"),
        (["--output", "x.webp", "--count", "3"], "--count is a strip's, and this is a movie"),
        (["--video", "--from", "0.3"], "from 0.3 s to 0.25 s is not in the recording"),
        (["--video", "--size", "61x80"], "both must be even, such as 62x80"),
        (["--video", "--fps", "0"], "0 frames a second"),
        (["--video", "--workers", "0"], "0 processes; it must be 1 or more"),
        (["--video", "--contacts"], "no contacts to mark"),
        (["--character", "left"], "do not name 'left'"),
    ],
)
def test_a_mistake_is_one_line(
    run: Path,
    own_handlers: None,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    says: str,
) -> None:
    assert main(["render", str(run), *arguments]) == 1

    (line,) = (line for line in capsys.readouterr().err.splitlines() if "error" in line)
    assert line.startswith("error: ") and says in line
    assert not (run / "video.mp4").exists()


def test_a_run_that_is_not_there_is_one_line(
    tmp_path: Path, own_handlers: None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", str(tmp_path / "nothing")]) == 1

    assert capsys.readouterr().err == f"error: no run or recording at {tmp_path / 'nothing'}\n"


def test_render_ends_at_once_when_it_is_interrupted(
    run: Path, processes: Processes, tmp_path: Path
) -> None:
    output = tmp_path / "long.png"
    process = processes.command(
        "render", str(run), "--count", "500", "--size", "360x360", "--output", str(output)
    )
    maps = Path(f"/proc/{process.pid}/maps")
    wait_until(lambda: "matplotlib" in maps.read_text(), "a process that is at work")

    process.send(signal.SIGINT)

    assert process.wait(10.0) == 130
    assert process.stderr.splitlines()[-1] == "interrupted"
    assert not output.exists()
