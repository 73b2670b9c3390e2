"""Driving from a real browser: what its keys and its button do to a character that is steered."""

import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_states
from msgs_config.messages import topics
from tests.support.browser import SHIFT, Browser, needs_chromium, one_browser
from tests.support.physics import character
from tests.support.ros import Process, Processes, ReceivedMessages, SimulatorClient, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.sharing, needs_chromium]

SOON = 60.0  # s
LOW_WINDOW = "--window-size=640,360"  # has the controls, and half of what takes long to draw
BUTTON = "Hold to drive"
STEERED = {"reference": "steered", "root_assistance": True}


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    with one_browser(tmp_path, LOW_WINDOW) as browser:
        yield browser


@pytest.fixture
def velocities(client: SimulatorClient) -> ReceivedMessages:
    return client.listen(topics.ACTIVE_CMD_VEL.of(topics.CONTROLLER_NODE))


@pytest.fixture
def reference(client: SimulatorClient) -> ReceivedMessages:
    return client.listen(topics.REFERENCE.of(topics.CONTROLLER_NODE))


def start(processes: Processes, hearers: int = 0, **controller: object) -> Process:
    """A character in real time, from when its states have a number of hearers."""
    joints = character("humanoid").layout.joint_names  # with the root
    simulator = {"wait_for_subscribers": hearers, "commanded_joints": joints}
    simulator |= {"real_time_factor": 1.0}
    return processes.composed(simulator, controller, character="humanoid")


def open_page(processes: Processes, browser: Browser) -> None:
    viewer = processes.node(topics.VIEWER_NODE, fresh=True)
    browser.open(str(wait_until(lambda: viewer.stdout.strip(), "the viewer's address")))


def shows_drive(browser: Browser) -> bool:
    return browser.place(BUTTON) is not None


def resting_place(browser: Browser) -> tuple[float, float]:
    """Where the button is once the page, which is still being built, moves it no more."""
    places: list[tuple[float, float] | None] = [None]

    def rests() -> bool:
        places.append(browser.place(BUTTON))
        return places[-1] is not None and places[-1] == places[-2]

    wait_until(rests, "the button rests", SOON, lambda: time.sleep(1.0))
    place = places[-1]
    assert place is not None
    return place


class HeldKey:
    """A key that is down, and repeated as a system does."""

    def __init__(self, browser: Browser, name: str, keys: int = 0) -> None:
        self._browser, self._name, self._keys = browser, name, keys
        self._next = time.monotonic() + 0.4  # s
        browser.key(name, keys=keys)

    def until(self, client: SimulatorClient, condition: Callable[[], object], what: str) -> None:
        """Hold it until a condition holds."""

        def step() -> object:
            self.repeat()
            return condition()

        client.spin_until(step, what, SOON)

    def repeat(self) -> None:
        """Repeat it if its time has come."""
        if time.monotonic() >= self._next:
            self._browser.key(self._name, repeated=True, keys=self._keys)
            self._next = time.monotonic() + 0.03

    def release(self) -> None:
        self._browser.release(self._name, keys=self._keys)


def last(velocities: ReceivedMessages) -> tuple[float, float, float]:
    twist = velocities.last.twist
    return twist.linear.x, twist.linear.y, twist.angular.z


def seen(velocities: ReceivedMessages) -> set[tuple[float, float, float]]:
    """All of them: on a busy machine repeats come late, and a held key has gaps."""
    twists = [message.twist for message in velocities.messages]
    return {(twist.linear.x, twist.linear.y, twist.angular.z) for twist in twists}


def goes_and_turns(browser: Browser, velocities: ReceivedMessages) -> bool:
    """Whether up and left were heard at once; press up again where a busy machine let it end."""
    if last(velocities) == (0.0, 0.0, 0.8):
        browser.key("ArrowUp")
    return (1.0, 0.0, 0.8) in seen(velocities)


def root(reference: ReceivedMessages, name: str) -> float:
    message = reference.last
    return float(message.position[list(message.name).index(name)])


@pytest.mark.nightly
def test_keys_walk_run_turn_and_stop_when_they_are_let_go_which_replays_to_the_bit(
    processes: Processes,
    browser: Browser,
    client: SimulatorClient,
    velocities: ReceivedMessages,
    reference: ReceivedMessages,
    tmp_path: Path,
) -> None:
    recorder = processes.node(topics.RECORDER_NODE, directory=str(tmp_path / "run"))
    open_page(processes, browser)
    simulator = start(processes, hearers=3, **STEERED)  # controller, recorder and client
    wait_until(lambda: shows_drive(browser), "the section Drive", SOON)
    client.spin_until(lambda: reference.messages, "a reference")
    assert not velocities.messages  # nobody has driven

    up = HeldKey(browser, "ArrowUp")
    up.until(client, lambda: root(reference, "root_x") > 0.5, "it walks ahead")
    assert seen(velocities) <= {(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)}
    assert abs(root(reference, "root_y")) < 0.1
    left = HeldKey(browser, "ArrowLeft")  # the system repeats this one alone
    left.until(client, lambda: goes_and_turns(browser, velocities), "it goes and turns")
    left.until(client, lambda: root(reference, "root_rz") > 0.8, "it turns left")
    left.release()
    up.release()
    client.spin_until(lambda: last(velocities) == (0.0, 0.0, 0.0), "it stops", SOON)

    right = HeldKey(browser, "ArrowRight", SHIFT)
    right.until(client, lambda: (0.0, 0.0, -0.8) in seen(velocities), "right")
    right.release()
    client.spin_until(lambda: last(velocities) == (0.0, 0.0, 0.0), "its end, or it counts on", SOON)
    run = HeldKey(browser, "ArrowUp", SHIFT)
    run.until(client, lambda: (2.2, 0.0, 0.0) in seen(velocities), "it runs")
    browser.key("Space")
    client.spin_until(lambda: last(velocities) == (0.0, 0.0, 0.0), "space stops it", SOON)

    for process in (simulator, recorder):
        process.send(signal.SIGINT)
        assert process.wait() == 0
    assert replay([read_recording(tmp_path / "run")]).identical
    again = replay_states(tmp_path / "run", progress=lambda _: None, tell=lambda _: None)
    assert again.identical


@pytest.mark.nightly
def test_the_button_drives_at_the_sliders_velocities_until_it_is_let_go_or_the_browser_dies(
    processes: Processes,
    browser: Browser,
    client: SimulatorClient,
    velocities: ReceivedMessages,
) -> None:
    start(processes, **STEERED)
    open_page(processes, browser)
    wait_until(lambda: shows_drive(browser), "the section Drive", SOON)
    published = client.listen(topics.CMD_VEL)

    def hold() -> tuple[float, float]:
        place, before = resting_place(browser), len(published.messages)
        browser.press(*place)
        client.spin_until(lambda: len(published.messages) > before + 10, "velocities", SOON)
        assert seen(velocities) <= {(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)}
        return place

    browser.mouse("mouseReleased", *hold())
    client.spin_until(lambda: last(velocities) == (0.0, 0.0, 0.0), "it stops", SOON)
    hold()
    browser.kill()
    client.spin_until(lambda: last(velocities) == (0.0, 0.0, 0.0), "it stops", SOON)


def test_a_character_that_follows_a_clip_cannot_be_driven(
    processes: Processes, browser: Browser, client: SimulatorClient, reference: ReceivedMessages
) -> None:
    start(processes, reference="clip", clip="walk", root_assistance=True)
    published = client.listen(topics.CMD_VEL)
    open_page(processes, browser)
    wait_until(lambda: browser.place("Pause") is not None, "the panel", SOON)
    wait_until(lambda: "humanoid" in browser.evaluate("document.body.innerText"), "it", SOON)

    ticks = len(reference.messages)
    client.spin_until(lambda: len(reference.messages) > ticks + 2 * 240, "two seconds", SOON)
    assert not shows_drive(browser)
    assert not published.messages
