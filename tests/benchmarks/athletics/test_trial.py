"""A trial's run is that of its machine."""

from pathlib import Path

from benchmarks.athletics.trial import Trial
from controller_node.behaviours.state_machine.file import machine_path, read_machine


def test_the_plan_has_the_machine_that_is_tried_and_no_other(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(machine_path("jump").read_text())

    plan = Trial(1.0).plan(read_machine(str(file)))

    assert plan.controller["machine"] == str(file)
