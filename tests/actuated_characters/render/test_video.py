"""Videos, decoded again by FFmpeg."""

import sys
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest

from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.video import check_video, write_video
from msgs_config.errors import ConfigurationError, RecordingError

SIZE = (96, 64)
BACKGROUND, SQUARE = (230, 240, 60), (40, 200, 110)


def pictures(count: int) -> Iterator[Picture]:
    """A square that goes to the right by two pixels a picture."""
    width, height = SIZE
    for number in range(count):
        picture = np.full((height, width, 3), BACKGROUND, dtype=np.uint8)
        picture[16:48, 4 + 2 * number : 36 + 2 * number] = SQUARE
        yield picture


def decoded(path: Path) -> list[Picture]:
    with av.open(str(path)) as video:
        return [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("video") / "square.mp4"
    write_video(path, pictures(12), SIZE, 24)
    return path


def test_a_video_is_what_browsers_play(video: Path) -> None:
    with av.open(str(video)) as container:
        (stream,) = container.streams
        context = stream.codec_context

        assert "mp4" in container.format.name.split(",")
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")
        assert (context.width, context.height) == SIZE
        assert (stream.frames, stream.average_rate) == (12, 24)
        assert stream.duration * stream.time_base == pytest.approx(0.5)
        times = [frame.time for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(12) / 24.0)
    content = video.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")  # it begins before all of it is there


def test_every_picture_is_there_in_order_and_in_its_colours(video: Path) -> None:
    frames = decoded(video)

    assert len(frames) == 12
    for frame, picture in zip(frames, pictures(12), strict=True):
        assert np.abs(frame.astype(int) - picture).mean() < 4.0
        np.testing.assert_allclose(frame[4, 4], BACKGROUND, atol=6)
        column = 20 + 2 * int(np.flatnonzero((picture[30] == SQUARE).all(axis=1))[0] // 2)
        np.testing.assert_allclose(frame[32, column], SQUARE, atol=6)


def test_the_same_pictures_give_the_same_file(video: Path, tmp_path: Path) -> None:
    write_video(tmp_path / "again.mp4", pictures(12), SIZE, 24)

    assert (tmp_path / "again.mp4").read_bytes() == video.read_bytes()


def test_what_breaks_off_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "video.mp4"
    path.write_text("an older one")

    def broken() -> Iterator[Picture]:
        for _ in range(20):  # more than the encoder looks ahead
            yield from pictures(5)
        assert len(list(tmp_path.iterdir())) == 2  # it is being written under another name
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(path, broken(), SIZE, 24)

    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "an older one"


def test_what_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "nothing" / "video.mp4"

    with pytest.raises(RecordingError, match=r"cannot write video .*: No such file or directory"):
        write_video(path, pictures(1), SIZE, 24)


@pytest.mark.parametrize(
    ("size", "fps", "says"),
    [
        ((95, 64), 24, "95x64 is not possible for a video; both must be even, such as 96x64"),
        ((96, 63), 24, "such as 96x64"),
        (SIZE, 0, "0 frames a second; it must be 1 to 240"),
        (SIZE, 241, "241 frames a second"),
    ],
)
def test_what_cannot_be_is_refused(
    tmp_path: Path, size: tuple[int, int], fps: int, says: str
) -> None:
    with pytest.raises(ConfigurationError, match=says):
        write_video(tmp_path / "video.mp4", pictures(1), size, fps)

    assert not list(tmp_path.iterdir())


def test_without_the_package_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)

    with pytest.raises(ConfigurationError, match=r"pip install 'actuated_characters\[video\]'"):
        check_video(SIZE, 24)


def test_without_the_encoder_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(av, "codecs_available", {"mpeg4"})

    with pytest.raises(ConfigurationError, match="without the encoder libx264"):
        check_video(SIZE, 24)
