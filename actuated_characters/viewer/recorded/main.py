"""Opens the page of a recorded run."""

from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from actuated_characters.bags.recording import Recording
from actuated_characters.bags.robots.reading import RobotSource
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.recorded.player import RecordedPlayer
from actuated_characters.viewer.recorded.run import check_comparable, read_run
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import describe_address, open_socket, start_server
from actuated_characters.viewer.web.server import stop_server as stop


def show_recorded(
    path: Path,
    others: Sequence[Path],
    source: RobotSource,
    told: Callable[[Sequence[Recording]], None],
    *,
    host: str,
    port: int | None,
    fps: float,
    skin: GivenSkin | None = None,
) -> None:
    """Show a recorded run, and others as its ghosts, until an interruption.

    `source` says whose they are, if they are bags of another robot; `told` is called with what was
    read; `skin` is a mesh from a file as the skin of every character.

    Raises:
        ActuatedCharactersError: a recording cannot be read, the others are of other characters, or
            the port cannot be listened on.
    """
    with Console(stderr=True).status("reading ..."):
        run = read_run(path, source)
        beside = [read_run(other, source) for other in others]
    told([each for shown in (run, *beside) for each in shown.recordings])
    for other in beside:
        check_comparable(run, other)
    rejections = Rejections()
    listening = open_socket(host, port)
    server = start_server(listening, RequestCheck(host), rejections.note)
    try:
        player = RecordedPlayer(server, run, beside, skin)
        for line in describe_address(host, listening.getsockname()[1]):
            print(line, flush=True)
        player.play(fps, rejections)
    finally:
        stop(server)
