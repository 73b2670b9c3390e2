"""What the player of a recorded run does beside drawing, without a browser."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from actuated_characters.viewer.recorded import player as player_module
from actuated_characters.viewer.recorded.player import RecordedPlayer
from actuated_characters.viewer.recorded.run import RecordedRun, read_run
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import open_socket, start_server, stop_server
from msgs_config.errors import RecordingError
from tests.support.bags import make_run, write_bag

LONG = 2000  # pictures in which anything here is done
FPS = 120.0  # Hz


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    directory = tmp_path_factory.mktemp("runs") / "run"
    directory.mkdir()
    write_bag(directory / "bag", make_run("pendulum", 0.5).messages())
    return read_run(directory)


class EndedFork:
    """A fork whose process has ended at once."""

    has_ended, error = True, ""

    def __init__(self, run: Path, time: float, push: str, settings: list[str]) -> None:
        del push, settings
        self.directory, self.time = run.with_name("run-fork"), time

    def cancel(self) -> None:
        pass


@pytest.fixture
def player(run: RecordedRun, monkeypatch: pytest.MonkeyPatch) -> Iterator[RecordedPlayer]:
    monkeypatch.setattr(player_module, "Fork", EndedFork)
    monkeypatch.setattr(
        player_module, "read_run", lambda path: RecordedRun(path, run.scene, run.starts)
    )
    monkeypatch.setattr("actuated_characters.viewer.recorded.ghosts.find_marks", lambda run: [])
    server = start_server(open_socket("127.0.0.1", 0), RequestCheck("127.0.0.1"), lambda _: None)
    yield RecordedPlayer(server, run, [])
    stop_server(server)


class Until(Rejections):
    """Interrupts the player, which asks it after each picture, once something is so."""

    def __init__(self, is_so: Callable[[], bool]) -> None:
        super().__init__()
        self._is_so, self.pictures = is_so, 0

    def take(self) -> list[str]:
        self.pictures += 1
        if self._is_so() or self.pictures == LONG:
            raise KeyboardInterrupt
        return []


def play_until(player: RecordedPlayer, is_so: Callable[[], bool]) -> None:
    until = Until(is_so)
    with pytest.raises(KeyboardInterrupt):
        player.play(FPS, until)
    assert until.pictures < LONG


def says(player: RecordedPlayer, words: str) -> bool:
    return words in player._panel._told.content


def test_pages_are_drawn_while_a_fork_is_read(
    player: RecordedPlayer, run: RecordedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on, drawn, waited = threading.Event(), list[int](), list[bool]()

    def read(path: Path) -> RecordedRun:
        waited.append(goes_on.wait(5.0))
        return RecordedRun(path, run.scene)

    def is_so() -> bool:
        drawn.append(1)
        if len(drawn) == 5:
            goes_on.set()
        return str(player._panel.ghost.value) == "run-fork"

    monkeypatch.setattr(player_module, "read_run", read)
    player.fork("", [])
    play_until(player, is_so)

    assert waited == [True]
    assert says(player, "run-fork; the ghost")


def test_a_fork_plays_on_from_its_time_wherever_the_time_line_is_by_now(
    player: RecordedPlayer, run: RecordedRun
) -> None:
    player._timeline.seek(0.25)
    player.fork("", [])
    player._timeline.seek(run.times[-1])
    times: list[float] = []

    def is_so() -> bool:
        if player._timeline.plays:
            times.append(player._timeline.time)
        return player._timeline.time >= 0.3 and bool(times)

    play_until(player, is_so)

    assert 0.25 - 1e-6 <= times[0] < 0.5
    assert times == sorted(times)


def test_a_fork_that_is_cancelled_while_it_is_read_becomes_no_ghost(
    player: RecordedPlayer, run: RecordedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, goes_on, ended = threading.Event(), threading.Event(), threading.Event()

    def read(path: Path) -> RecordedRun:
        begun.set()
        goes_on.wait(5.0)
        ended.set()
        raise RecordingError(f"{path} should not be looked at")

    def is_so() -> bool:
        if begun.is_set() and not goes_on.is_set():
            player.cancel()
            goes_on.set()
        return ended.wait(0.05) and after.wait(0.05)

    after = threading.Event()
    threading.Timer(0.5, after.set).start()
    monkeypatch.setattr(player_module, "read_run", read)
    player.fork("", [])
    play_until(player, is_so)

    assert says(player, "the fork is cancelled")
    assert "run-fork" not in player._panel.ghost.options


def test_a_fork_that_cannot_be_read_is_one_line_and_another_one_can_be_made(
    player: RecordedPlayer, run: RecordedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path) -> RecordedRun:
        raise RecordingError(f"{path.name} is no bag")

    monkeypatch.setattr(player_module, "read_run", fail)
    player.fork("", [])
    play_until(player, lambda: says(player, "error: run-fork is no bag"))

    player.fork("", [])
    assert says(player, "forking at")


def test_an_error_that_is_nobodys_mistake_ends_the_player(
    player: RecordedPlayer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path) -> RecordedRun:
        raise ZeroDivisionError(path)

    monkeypatch.setattr(player_module, "read_run", fail)
    player.fork("", [])
    with pytest.raises(ZeroDivisionError):
        player.play(FPS, Until(lambda: False))
