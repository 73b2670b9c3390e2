"""Runs by the command line with all their processes, and runs over topics from the test itself."""

import json
import os
import uuid
from pathlib import Path
from typing import Any

import pytest
import yaml

from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.runs.execution import run_over_topics
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.inputs import NO_INPUTS, PlannedInputs
from tests.support.ros import Process, Processes, wait_until

FAMILY = "ACTUATED_CHARACTERS_TEST"
"""An environment variable that all processes of a run have."""

ONE_CHUNK = 500_000  # bytes; a bag goes to the disk in pieces of about 1 MB


def family(mark: str) -> dict[int, str]:
    """Command lines of all living processes with a mark in their environment, by pid."""
    wanted = f"{FAMILY}={mark}".encode()
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal():
            continue
        try:
            if wanted in (entry / "environ").read_bytes().split(b"\0"):
                found[int(entry.name)] = (entry / "cmdline").read_text().replace("\0", " ")
        except OSError:  # it has ended, or is somebody else's
            continue
    return found


class Run:
    """A run, and the processes that it has started."""

    def __init__(self, processes: Processes, *arguments: str, **environment: str) -> None:
        self._mark = uuid.uuid4().hex
        inherited = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
        self.process: Process = processes.command(
            *arguments, environment=inherited | environment | {FAMILY: self._mark}
        )

    @property
    def family(self) -> dict[int, str]:
        """Command lines of all its processes that live, by pid."""
        return family(self._mark)

    def pid_of(self, module: str) -> int:
        """The process that runs a module."""
        (pid,) = [pid for pid, command in self.family.items() if f"-m {module} " in command]
        return pid

    def finish(self) -> "Run":
        """Wait for a good end."""
        assert self.process.wait(120.0) == 0, self.process.stderr
        return self

    @property
    def error(self) -> str:
        """Its error, the only one in its log, in one line."""
        assert "Traceback" not in self.process.stderr
        errors = [line for line in self.process.stderr.splitlines() if "error" in line.lower()]
        (line,) = errors
        assert line.startswith("error: ")
        return line

    def wait_for_ticks(self, directory: Path) -> "Run":
        """Wait until it is well under way: the first chunk of its bag has gone to the disk."""
        bag = directory / "bag" / "bag.mcap"
        wait_until(lambda: bag.exists() and bag.stat().st_size > ONE_CHUNK, "ticks of the run")
        return self


def summary_of(directory: Path) -> dict[str, Any]:
    """A run's figures."""
    return dict(json.loads((directory / "summary.json").read_text()))


def parameters_of(directory: Path, node: str) -> dict[str, Any]:
    """The parameters that a run has given to a node."""
    content = yaml.safe_load((directory / "parameters" / f"{node}.yaml").read_text())
    return dict(content[node]["ros__parameters"])


def run_plan_here(plan: RunPlan, directory: Path, inputs: PlannedInputs = NO_INPUTS) -> None:
    """Run a plan in the test's own process, whose bag is that of a run over topics."""
    prepare_directory(directory, overwrite=False)
    run_in_process(plan, directory, inputs=inputs)


def run_plan(plan: RunPlan, directory: Path, mark: str = "", **options: Any) -> int:
    """Run a plan over topics on a domain of its own; the most of its marked processes at once."""
    prepare_directory(directory, overwrite=False)
    alive = [0]
    options.setdefault("write_bag", True)
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("ROS_DOMAIN_ID", raising=False)
        patch.setenv(FAMILY, mark)
        run_over_topics(
            plan, directory, progress=lambda _: alive.append(len(family(mark))), **options
        )
    return max(alive)
