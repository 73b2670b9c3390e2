"""A study's runner that notes which cases it was asked for."""

from pathlib import Path

from lecture.framework.catalogue import load_study
from lecture.framework.result import StudyResult
from lecture.framework.runner import Runner
from lecture.framework.study import RunResult, RunSpec


class InProcessRunner(Runner):
    """Runs a study's cases one by one; files that they need go to a directory."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory, keep_runs=False, report=lambda label, share: None)
        self.cases: list[RunSpec] = []  # that were run

    def run(self, case: RunSpec) -> RunResult:
        """Run a case to its end, or until it diverges."""
        self.cases.append(case)
        return super().run(case)

    def study(self, name: str) -> StudyResult:
        """Run all of a study."""
        return load_study(name).run(self)
