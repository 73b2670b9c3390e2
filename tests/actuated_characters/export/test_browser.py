"""A clip as glTF in a browser: three.js loads it, draws it and plays it, in viser's page."""

from pathlib import Path

import numpy as np
import pytest
import viser

from actuated_characters.export.gltf_scene import make_document
from actuated_characters.export.sources import of_clip
from tests.support.browser import Pixels, needs_chromium, one_browser
from tests.support.physics import character
from tests.support.ros import wait_until

pytestmark = [pytest.mark.slow, pytest.mark.sharing, needs_chromium]

SOON = 60.0  # s: WebGL by a processor
COLOURED = 32  # of 255: how much more a colour than the grey of the ground
LEAST_PIXELS = 500  # of a character
BODY = (slice(150, None), slice(0, 420))  # of the page, beside notes and panel


def coloured(pixels: Pixels) -> Pixels:
    """Which pixels have a colour, as the limbs of the humanoid do."""
    part = pixels[BODY].astype(int)
    return np.asarray(part.max(axis=2) - part.min(axis=2) > COLOURED)


def test_the_walker_walks_in_a_browser(tmp_path: Path) -> None:
    motion = of_clip(character("humanoid"), "walk")
    glb = make_document(motion, motion.sample_times(), ground=True).to_glb()
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        server.scene.set_up_direction("+y")
        server.initial_camera.position = (2.5, 1.2, 1.4)
        server.initial_camera.look_at = (-0.8, 0.6, 0.6)
        server.scene.add_glb("/walk", glb)
        with one_browser(tmp_path) as browser:
            browser.open(f"http://127.0.0.1:{server.get_port()}")
            wait_until(lambda: coloured(browser.pixels()).sum() > LEAST_PIXELS, "a humanoid", SOON)
            first = coloured(browser.pixels())
            shares = []

            def has_moved() -> bool:
                """Whether much of what was coloured is elsewhere now."""
                now = coloured(browser.pixels())
                shares.append((now & ~first).sum() / max(int(now.sum()), 1))
                return bool(now.sum() > LEAST_PIXELS and shares[-1] > 0.3)

            wait_until(has_moved, "a step", SOON)
            assert not browser.console
    finally:
        server.stop()
