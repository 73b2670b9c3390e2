"""The directory of a trial's results: what was on trial, and what is needed to run it again."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from actuated_characters.sweep.journal import JOURNAL, Done
from actuated_characters.sweep.row import Outcome
from actuated_characters.trial.controller_file import Controller
from actuated_characters.trial.trial_set import TrialSet
from msgs_config.errors import RunError
from msgs_config.files import read_text
from msgs_config.versions import installed_versions
from msgs_config.whole_files import write_whole

RESULT, CONTROLLER, FILMS = "trial.json", "controller.yaml", "films"
TRIALS = "trials"
"""The folder of the set's file, which keeps its name."""
_FORMAT = 1


@dataclass(frozen=True)
class Result:
    """What a directory of results says of itself."""

    directory: Path
    folder: Path  # where the controller's command runs
    trials: Path  # the set's file
    engine: str
    versions: Mapping[str, str]
    digests: Mapping[str, str]  # of the controller's files

    @property
    def controller(self) -> Path:
        """The controller's file, as it was."""
        return self.directory / CONTROLLER


def write_result(
    directory: Path, file: Path, controller: Controller, trials: TrialSet, engine: str
) -> None:
    """Write what `verify` needs beside the journal.

    Raises:
        RecordingError: it cannot be written.
    """
    (directory / TRIALS).mkdir(exist_ok=True)
    write_whole(directory / CONTROLLER, read_text(file, RunError))
    write_whole(directory / TRIALS / f"{trials.name}.yaml", trials.text)
    content = {
        "trial": _FORMAT,
        "controller": controller.name,
        "folder": str(file.absolute().parent),
        "set": trials.name,
        "engine": engine,
        "versions": installed_versions(),
        "digests": controller.digests(),
    }
    write_whole(directory / RESULT, json.dumps(content, indent=2) + "\n")


def read_result(directory: Path) -> Result:
    """Read the directory of a trial's results.

    Raises:
        RunError: it is none.
    """
    path = directory / RESULT
    if not path.is_file():
        raise RunError(f"{directory} holds no results of `trial`")
    try:
        content: dict[str, Any] = json.loads(read_text(path, RunError))
        if content["trial"] != _FORMAT:
            raise RunError(f"{path} is of another version of this package")
        return Result(
            directory,
            Path(content["folder"]),
            directory / TRIALS / f"{content['set']}.yaml",
            str(content["engine"]),
            dict(content["versions"]),
            dict(content["digests"]),
        )
    except (ValueError, TypeError, KeyError) as error:
        raise RunError(f"{path}: no result of a trial") from error


def read_done(directory: Path) -> dict[int, Done]:
    """The rows of a trial that are done, by their numbers.

    Raises:
        RunError: there is no journal of them.
    """
    path = directory / JOURNAL
    lines = read_text(path, RunError).splitlines(keepends=True)
    try:
        records = [json.loads(line) for line in lines[1:] if line.endswith("\n")]
        rows = [record for record in records if "row" in record]
        return {
            each["row"]: Done(each["row"], Outcome(**each["outcome"]), each["by"]) for each in rows
        }
    except (ValueError, TypeError, KeyError) as error:
        raise RunError(f"{path}: no journal of a trial") from error
