"""Opens the page of a recorded run."""

from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from actuated_characters.bags.recording import Recording
from actuated_characters.bags.robots.reading import RobotSource
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.recorded.player import RecordedPlayer
from actuated_characters.viewer.recorded.run import check_comparable, read_run
from actuated_characters.viewer.web.server import serving


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
    with serving(host, port) as (server, rejections, address):
        player = RecordedPlayer(server, run, beside, skin)
        for line in address:
            print(line, flush=True)
        player.play(fps, rejections)
