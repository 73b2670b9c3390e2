"""Lines of text for pictures."""

from functools import lru_cache

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from actuated_characters.render.engine.renderer import Picture

_SHARE = 15  # a picture is so many times as high as its caption ...
_MIN_PIXELS = 16  # ... but a caption has at least so many pixels
_DPI = 72  # a point is a pixel then
_WHITE = 255.0


def captioned(picture: Picture, caption: str) -> Picture:
    """A picture (h, w, 3) with a line of text above it."""
    height, width, _ = picture.shape
    return np.concatenate((_line(caption, width, _line_height(height), 0.5), picture))


def write_on(picture: Picture, caption: str) -> Picture:
    """A picture (h, w, 3) with a line of dark text on its upper left corner."""
    height, width, _ = picture.shape
    line = _line(caption, width, _line_height(height), 0.02)
    below = slice(len(line) // 4, min(len(line) // 4 + len(line), height))
    light = line[: below.stop - below.start] / _WHITE  # keeps the smooth edges of the text
    written = picture.copy()
    written[below] = np.rint(light * picture[below])
    return written


def _line_height(height: int) -> int:
    return max(_MIN_PIXELS, height // _SHARE)


@lru_cache(maxsize=64)
def _line(text: str, width: int, height: int, left: float) -> Picture:
    """Black text on white (height, width, 3), in the middle or from a share of the width on."""
    figure = Figure(figsize=((width + 0.5) / _DPI, (height + 0.5) / _DPI), dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    align = "center" if left == 0.5 else "left"
    size = min(0.7 * height, 1.8 * width / max(len(text), 1))  # a long text in smaller letters
    figure.text(left, 0.5, text, ha=align, va="center", fontsize=size)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
