"""The command `fork` in a process beside the viewer."""

from collections.abc import Sequence
from pathlib import Path

from actuated_characters.bags.format.metadata import BAG
from actuated_characters.viewer.controls.command_process import CommandProcess
from actuated_characters.viewer.recorded.export import free_path


class Fork(CommandProcess):
    """A fork of a recorded run that is being made."""

    def __init__(self, run: Path, time: float, push: str, settings: Sequence[str]) -> None:
        """Begin: from a time, s, with a push `LINK:FX,FY,FZ` there, and parameters."""
        self.time = time
        run = run.absolute()
        run = run.parent if run.name == BAG else run
        self.directory = free_path(run.parent, f"{run.name}-fork", "")
        arguments = ["fork", str(run), "--at", f"{time:.9g}", "--output", str(self.directory)]
        if push:
            arguments += ["--push", f"{push}@{time:.9g}"]
        for each in settings:
            arguments += ["--set", each]
        super().__init__(arguments)
