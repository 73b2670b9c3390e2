"""One row of a trial: a run over topics in a ROS domain of its own, judged by its bag."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from actuated_characters.bags.recording import read_recording
from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
from actuated_characters.runs.execution import ControllerError, run_over_topics
from actuated_characters.runs.in_process import Progress
from actuated_characters.sweep.grid import Cell
from actuated_characters.sweep.row import Ask, AskedRun, Outcome, RowTask, failed, with_one_thread
from actuated_characters.trial.controller_file import Controller
from actuated_characters.trial.goal import Goal, Judgement, judge
from actuated_characters.trial.trial_set import FIGURES
from msgs_config.errors import ActuatedCharactersError, ConfigurationError

_ASSISTANCE, _COMMANDED = "controller_node.root_assistance", "sim_node.commanded_joints"


@dataclass(frozen=True)
class Trial:
    """Who is on trial, and what is asked in each row."""

    controller: Controller
    goals: Mapping[int, Goal]  # by the row's number
    ask: Ask

    def asked(self, arguments: Sequence[str]) -> AskedRun:
        """The run that a row's arguments ask for.

        Raises:
            ActuatedCharactersError: there is none, or the controller cannot take part in it.
        """
        if self.controller.foreign is None:
            return self.ask(with_one_thread(arguments))
        given = [each.partition(":=")[0].removeprefix("--set=") for each in arguments]
        if not {_ASSISTANCE, _COMMANDED} & set(given):  # nobody moves the root by a force
            arguments = [*arguments, f"--set={_ASSISTANCE}:=false"]
        asked = self.ask(arguments)
        for what in ("strengths", "behaviours"):
            if asked.inputs.by_name()[what]:
                raise ConfigurationError(f"{what} of a timeline are for controller_node alone")
        return asked

    def check(self, number: int, arguments: Sequence[str]) -> AskedRun:
        """The run of a row whose goal fits it; raises as `asked` does."""
        asked = self.asked(arguments)
        self.goals[number].check(asked.plan.character.layout)
        return asked

    def run(
        self,
        task: RowTask,
        ask: Ask,
        directory: Path,
        progress: Progress = lambda ticks: None,
    ) -> Outcome:
        """Run a row into a directory; what its controller is to blame for is part of the outcome.

        What `progress` raises ends the run in good order.

        Raises:
            RunError: something else failed.
            RecordingError: the files cannot be written.
        """
        del ask
        try:
            asked = self.check(task.number, task.arguments)
        except ActuatedCharactersError as error:
            return replace(failed(error, directory), is_refused=True)
        prepare_directory(directory, overwrite=False)
        try:
            run_over_topics(
                asked.plan,
                directory,
                write_bag=True,
                progress=progress,
                recording=asked.recording,
                inputs=asked.inputs,
                foreign=self.controller.foreign,
                start_timeout=self.controller.start_timeout,
            )
        except ControllerError as error:
            return failed(error, directory)
        return _outcome(asked, self.goals[task.number], directory)


def _outcome(asked: AskedRun, goal: Goal, directory: Path) -> Outcome:
    """What the world says; where the controller said that it wanted to be does not count."""
    recording, (summary, _) = read_recording(directory), read_metrics(directory)
    judgement = judge(
        goal,
        asked.plan.character,
        recording.position,
        float(asked.plan.simulator["rate"]),  # type: ignore[arg-type]
        asked.plan.reference,
        recording.world.terrain,
    )
    return Outcome(_figures(judgement, summary), judgement.why, summary["state_hash"])


def _figures(judgement: Judgement, summary: Mapping[str, Any]) -> dict[str, Cell]:
    judged: dict[str, Cell] = {
        "survived": judgement.has_survived,
        "failed_at_s": judgement.failed_at,
        "travelled_m": judgement.travelled,
        "joint_error_mean_rad": judgement.joint_error,
    }
    return judged | {name: summary[name] for name in FIGURES if name not in judged}
