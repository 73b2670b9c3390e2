"""Writes pictures as a video: H.264 in MP4, as browsers and slides play it."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.render.engine.renderer import Picture
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.runtime.extras import require_extra
from msgs_config.whole_files import replacing

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

FASTEST = 240  # frames a second

_ENCODER = "libx264"
_QUALITY = {"crf": "20", "preset": "medium"}  # edges and tiles without visible blocks
_KEY_FRAME_S = 1.0  # s between frames that a player can jump to
_BT_709 = 1  # H.264's number of the colour space that players take for granted
_LIMITED_RANGE = 1


def write_video(path: Path, pictures: Iterable[Picture], size: Size, fps: int) -> None:
    """Write pictures (h, w, 3) as a video of constant rate, whole or not at all.

    It is written under another name, which it has until it is finished. The same pictures give
    the same file.

    Args:
        path: The MP4 file; one that is there is replaced.
        pictures: Its frames, each taken when the one before it is written.
        size: Width and height of each of them in pixels, both even.
        fps: Frames a second.

    Raises:
        ConfigurationError: PyAV is not installed, or the size or the rate cannot be.
        RecordingError: the file cannot be written.
    """
    check_video(size, fps)
    with replacing(path) as part, _writing(path):
        import av

        with av.open(str(part), "w", format="mp4", options={"movflags": "+faststart"}) as video:
            stream = _add_stream(video, size, fps)
            for number, picture in enumerate(pictures):
                frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(
                    format="yuv420p", dst_colorspace=_BT_709, dst_color_range=_LIMITED_RANGE
                )
                frame.pts = number
                video.mux(stream.encode(frame))
            video.mux(stream.encode(None))


def check_video(size: Size, fps: int) -> None:
    """Check what would be a pity to find out after all the work; raises as `write_video` does."""
    width, height = size
    if width % 2 or height % 2:
        raise ConfigurationError(
            f"size {width}x{height} is not possible for a video; "
            f"both must be even, such as {width + width % 2}x{height + height % 2}"
        )
    if not 1 <= fps <= FASTEST:
        raise ConfigurationError(f"{fps} frames a second; it must be 1 to {FASTEST}")
    require_extra("video", "a film")
    import av

    if _ENCODER not in av.codecs_available:
        raise ConfigurationError(
            f"the package 'av' here is built without the encoder {_ENCODER}; "
            "its wheels from the package index have it"
        )


def _add_stream(video: "OutputContainer", size: Size, fps: int) -> "VideoStream":
    from av.video.stream import VideoStream

    interval = {"g": str(max(1, round(_KEY_FRAME_S * fps)))}
    stream = video.add_stream(_ENCODER, rate=fps, options=_QUALITY | interval)
    assert isinstance(stream, VideoStream)
    stream.width, stream.height = size
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.thread_count = 1  # what several threads write depends on their number
    context.colorspace = context.color_primaries = context.color_trc = _BT_709
    context.color_range = _LIMITED_RANGE
    return stream


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """What the file system or the encoder objects to, as one line."""
    import av

    try:
        yield
    except (OSError, av.FFmpegError) as error:
        reason = error.strerror or str(error)
        raise RecordingError(f"cannot write video {path}: {reason}") from error
