"""Makes a study's runs."""

import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.throws import plan_throws
from actuated_characters.runs.planned.wrenches import PlannedPush
from lecture.framework.study import RunResult, RunSpec
from msgs_config.errors import RunError, SimulationError

Report = Callable[[str, float], None]
"""Called with a run's label and the share of it that is done."""

_DIVERGED = "diverged at tick"
_UNREAD = [  # topics that nothing reads, at a cost each tick
    "odom",
    "visualization",
    "description_joint_states",
    "controller_node/net_wrench",
]


class Runner:
    """Runs cases in this process, with the nodes and the bags of a run over topics."""

    def __init__(
        self, directory: Path, *, keep_runs: bool, report: Report, fine: bool = False
    ) -> None:
        """Files go below `directory`; a run's are removed once they were read, or kept."""
        self._directory = directory
        self._keep_runs, self.fine = keep_runs, fine
        self._report = report

    def run(self, case: RunSpec) -> RunResult:
        """Run a case; one that diverges ends there."""
        plan, velocities = case.plan()
        throws, _ = plan_throws(plan, case.throws)
        directory = self._directory / "runs" / case.label
        prepare_directory(directory, overwrite=True)
        diverged = ""
        self._report(case.label, 0.0)
        try:
            run_in_process(
                plan,
                directory,
                progress=lambda ticks: self._report(case.label, min(ticks / plan.ticks, 1.0)),
                recording={"exclude": _UNREAD if case.contacts else [*_UNREAD, "contacts"]},
                inputs=PlannedInputs(case.pushes, throws, velocities),
            )
        except SimulationError as error:
            if _DIVERGED not in str(error):
                raise
            diverged = str(error).partition(": ")[2]
        self._report(case.label, 1.0)
        recording, (summary, _) = read_recording(directory), read_metrics(directory)
        _check_pushes(case.pushes, recording)
        if not self._keep_runs:
            shutil.rmtree(directory)
            with suppress(OSError):  # other runs may be kept there
                directory.parent.rmdir()
        return RunResult(recording, summary, diverged)

    def path(self, name: str) -> Path:
        """The path for a file of that name; its directory exists."""
        self._directory.mkdir(parents=True, exist_ok=True)
        return self._directory / name


def _check_pushes(pushes: Sequence[PlannedPush], run: Recording) -> None:
    """Raise RunError unless each push that was planned within the run has really acted."""
    for push in pushes:
        tick = int(np.searchsorted(run.stamps_ns, push.stamp_ns))
        if tick >= len(run.stamps_ns) - 1:
            continue
        applied = run.applied_wrench[tick] if run.applied_wrench else None
        if applied is None or push.link not in applied.links:
            raise RunError(f"the push on '{push.link}' at {push.stamp_ns} ns did not act")
