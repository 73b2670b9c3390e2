"""The viewer in a real browser: what its page shows, and what a mouse does to the simulation."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import pytest
import viser
from numpy.typing import NDArray
from websockets.sync.client import connect

from actuated_characters.viewer.drawing.framing import EYE, LOOK_AT
from msgs_config.messages import topics
from tests.support.browser import SHIFT, Browser, Pixels, needs_chromium, one_browser
from tests.support.page_client import PageClient
from tests.support.ros import Process, Processes, SimulatorClient, stamp_ns, tick_of, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.sharing, needs_chromium]

SOON = 60.0  # s: WebGL by a processor that does other things as well
Mask = NDArray[np.bool_]

WARM = 8  # of 255: how much redder than blue; ground and sky are bluer, a ghost is green
LEAST_PIXELS = 200  # of a character
NEAR = 60.0  # pixels between two pictures of it, walking in one place
BODY = (0.3, 0.55, 0.25, 0.8)  # left, right, top, bottom as shares of the page: without the panel


def start_walker(processes: Processes) -> Process:
    """A humanoid that walks as a clip has it, its root assisted, in real time."""
    walk = {"reference": "clip", "clip": "walk", "root_assistance": True}
    simulator = {"real_time_factor": 1.0, "commanded_joints": _joints()}
    return processes.composed(simulator, walk, character="humanoid")


@pytest.fixture
def standing(processes: Processes) -> Process:
    """A humanoid that holds its rest pose, its root assisted, in real time."""
    simulator = {"real_time_factor": 1.0, "commanded_joints": _joints()}
    return processes.composed(simulator, {"root_assistance": True}, character="humanoid")


def _joints() -> list[str]:
    from msgs_config.character.loading import load_character

    return load_character("humanoid").layout.joint_names


@pytest.fixture
def viewer(processes: Processes) -> Process:
    return processes.node(topics.VIEWER_NODE, fresh=True)


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    with one_browser(tmp_path) as browser:
        yield browser


def address_of(viewer: Process) -> str:
    def address() -> str:
        assert viewer.exit_code is None, viewer.stderr
        return viewer.stdout.strip()

    return str(wait_until(address, "the viewer's address"))


def body_of(pixels: Pixels) -> Mask:
    """Which pixels of the page, near its middle, are of a trunk or of left limbs."""
    height, width = pixels.shape[:2]
    left, right, top, bottom = BODY
    red, green, blue = np.moveaxis(pixels.astype(int), 2, 0)
    found = (red > blue + WARM) & (red > green)
    found &= (blue > 60) | (green < 150)  # the centre of mass is yellow, and cannot be grabbed
    found[: round(top * height)] = found[round(bottom * height) :] = False
    found[:, : round(left * width)] = found[:, round(right * width) :] = False
    return found


def grip_of(body: Mask) -> tuple[float, float]:
    """The pixel (x, y) nearest to the middle of a body that has the body on all sides."""
    inner = body.copy()
    for axis, way in ((0, -2), (0, 2), (1, -2), (1, 2)):
        inner &= np.roll(body, way, axis)
    places = np.argwhere(inner if inner.any() else body)
    y, x = places[np.argmin(np.abs(places - np.argwhere(body).mean(axis=0)).sum(axis=1))]
    return float(x), float(y)


def until_seen(browser: Browser, viewer: Process) -> tuple[float, float]:
    """Load the page, and wait for the character; a pixel (x, y) in the middle of it.

    The camera goes nearer once it is there: so two pictures must have it at nearly one place.
    """
    browser.open(address_of(viewer))
    places: list[tuple[float, float] | None] = [None]

    def rests() -> bool:
        body = body_of(browser.pixels())
        places.append(grip_of(body) if body.sum() > LEAST_PIXELS else None)
        before, now = places[-2:]
        return before is not None and now is not None and math.dist(before, now) < NEAR

    wait_until(rests, "a character on the page", SOON)
    place = places[-1]
    assert place is not None
    return place


def root_of(client: SimulatorClient) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    state = client.states.last
    names = list(state.name)
    return np.array([state.position[names.index(f"root_{axis}")] for axis in "xyz"])


@pytest.mark.nightly
def test_a_click_with_shift_throws_a_ball_that_hits(
    standing: Process, viewer: Process, browser: Browser, client: SimulatorClient
) -> None:
    thrown, contacts = client.listen(topics.APPLIED_THROW), client.listen(topics.CONTACTS)
    x, y = until_seen(browser, viewer)

    clicked_at = -np.inf

    def click() -> None:
        """Click, again where a page that is slow to draw has not found the body."""
        nonlocal clicked_at
        if time.monotonic() - clicked_at > 5.0:
            clicked_at = time.monotonic()
            browser.press(x, y, keys=SHIFT)
            browser.mouse("mouseReleased", x, y, keys=SHIFT)

    client.spin_sending(click, lambda: thrown.messages, "a ball")
    numbers = dict(zip(thrown.last.name, thrown.last.position, strict=True))
    assert numbers["mass"] == 2.0
    released = stamp_ns(thrown.messages[0])
    feet = {"right_ankle", "left_ankle"}

    def struck() -> bool:
        """Asked after each message: they come too fast for all of them to be read each time."""
        if not contacts or stamp_ns(contacts.last) <= released:
            return False
        return bool(set(contacts.last.joint_names) - feet)

    client.spin_sending(click, struck, "a ball hits")
    assert standing.exit_code is None


def text_of(browser: Browser) -> str:
    return str(browser.evaluate("document.body.innerText"))


def test_a_page_shows_the_ground_then_the_walker_and_its_controls_act(
    processes: Processes, viewer: Process, browser: Browser, client: SimulatorClient
) -> None:
    browser.open(address_of(viewer))
    wait_until(lambda: "no simulator" in text_of(browser), "the panel", SOON)
    assert not body_of(browser.pixels()).any()

    walking = start_walker(processes)

    check_that_it_walks_in_the_middle(browser, viewer)
    check_that_a_control_sets_the_controllers_parameter(browser, client)
    check_that_pause_holds_the_tick_and_resume_lets_it_go_on(browser, client)
    assert walking.exit_code is None


def check_that_it_walks_in_the_middle(browser: Browser, viewer: Process) -> None:
    until_seen(browser, viewer)

    def is_in_the_middle() -> bool:
        body = body_of(browser.pixels())
        if not body.any():
            return False
        (x, y), (height, width) = grip_of(body), body.shape
        return abs(x / width - 0.5) < 0.15 and abs(y / height - 0.5) < 0.25

    # a page that draws slowly has the first pictures from where its camera was
    wait_until(is_in_the_middle, "the camera looks at it", SOON)
    first = body_of(browser.pixels())
    wait_until(
        lambda: (first ^ body_of(browser.pixels())).sum() > LEAST_PIXELS // 2,
        "the walker moves",
        SOON,
    )
    assert is_in_the_middle()  # the world follows it
    assert "humanoid" in text_of(browser)
    assert not browser.console


def check_that_a_control_sets_the_controllers_parameter(
    browser: Browser, client: SimulatorClient
) -> None:
    wait_until(lambda: browser.click("Balance"), "the controller's parameters", SOON)

    node = topics.CONTROLLER_NODE
    client.spin_until(
        lambda: client.get_parameters(node, ["balance.enabled"]) == [True], "balance", SOON
    )
    wait_until(lambda: "balance.enabled True: set" in text_of(browser), "that it is set", SOON)


def check_that_pause_holds_the_tick_and_resume_lets_it_go_on(
    browser: Browser, client: SimulatorClient
) -> None:
    client.spin_until(lambda: client.states.messages, "a state")

    assert browser.click("Pause")
    wait_until(lambda: "sim_node: paused" in text_of(browser), "paused", SOON)
    report = client.reported(paused=True)
    tick = next(int(item.value) for item in report.values if item.key == "tick")
    client.spin_until(lambda: tick_of(client.states.last) >= tick, "the last state")
    again = len(client.diagnostics.messages)
    client.spin_until(lambda: len(client.diagnostics.messages) > again + 1, "two more reports")
    assert tick_of(client.states.last) == tick

    assert browser.click("Step")
    client.spin_until(lambda: tick_of(client.states.last) == tick + 1, "a step", SOON)
    assert browser.click("Resume")
    client.spin_until(lambda: tick_of(client.states.last) > tick + 10, "it goes on", SOON)


def drag(browser: Browser, x: float, y: float, steps: int) -> None:
    """To the right, by 8 pixels a step."""
    browser.press(x, y)
    for step in range(1, steps + 1):
        browser.mouse("mouseMoved", x + 8 * step, y, pressed=True)


@pytest.mark.nightly
def test_a_drag_to_the_right_pushes_to_the_right_until_it_is_let_go_or_the_browser_is_killed(
    standing: Process, viewer: Process, browser: Browser, client: SimulatorClient
) -> None:
    applied = client.listen(topics.APPLIED_WRENCH)
    forward = np.array(LOOK_AT) - np.array(EYE)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    x, y = until_seen(browser, viewer)
    client.spin_until(lambda: client.states.messages, "a state")
    before = root_of(client)

    drag(browser, x, y, steps=10)

    client.spin_until(lambda: (root_of(client) - before) @ right > 0.02, "the root moves", SOON)
    pushes = [message for message in applied.messages if message.wrench]
    # their sum, to which those of a mouse that has hardly moved add nothing
    forces = [np.array([w.force.x, w.force.y, w.force.z]) for m in pushes for w in m.wrench]
    impulse = np.sum(forces, axis=0)
    assert impulse @ right > 0.9 * np.linalg.norm(impulse)
    assert len({name for message in pushes for name in message.joint_names}) == 1

    browser.mouse("mouseReleased", x + 80, y)
    client.spin_until(lambda: not applied.last.wrench, "no push any more")
    client.spin_until(lambda: (root_of(client) - before) @ right < 0.015, "the root goes back")
    assert standing.exit_code is None

    drag(browser, x, y, steps=5)
    client.spin_until(lambda: applied.last.wrench, "a push", SOON)
    browser.kill()

    client.spin_until(lambda: not applied.last.wrench, "no push any more", SOON)
    tick = tick_of(client.states.last)
    client.spin_until(lambda: tick_of(client.states.last) > tick + 240, "it goes on")
    assert standing.exit_code is None
    assert viewer.exit_code is None
    assert "Traceback" not in viewer.stderr
    spoken: list = [f"viser-v{viser.__version__}"]
    address = address_of(viewer).replace("http", "ws")
    with connect(address, max_size=None, subprotocols=spoken) as other:
        other.close()


@pytest.mark.nightly
def test_a_reload_brings_all_back_ten_pages_are_served_at_once_and_another_simulator_is_shown(
    processes: Processes, viewer: Process, browser: Browser
) -> None:
    walking = start_walker(processes)
    until_seen(browser, viewer)
    port = int(address_of(viewer).rpartition(":")[2])

    with ExitStack() as pages:
        others = [pages.enter_context(PageClient(port)) for _ in range(9)]
        until_seen(browser, viewer)
        before = [page.pictures for page in others]
        wait_until(
            lambda: all(page.pictures > n + 20 for page, n in zip(others, before, strict=True)),
            "pictures for all",
            SOON,
        )
    assert walking.exit_code is None
    assert "Traceback" not in viewer.stderr

    walking.end()
    text = text_of(browser)
    processes.composed({"real_time_factor": 1.0}, character="pendulum")

    def shows_the_other() -> bool:
        with suppress(AssertionError):  # while the page loads itself once more
            shown = text_of(browser)
            return "pendulum" in shown and "humanoid" not in shown
        return False

    assert "humanoid" in text
    wait_until(shows_the_other, "the other character", SOON, lambda: time.sleep(0.1))
    assert viewer.exit_code is None
