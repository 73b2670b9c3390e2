"""Runs rows of a trial once more, and names the first thing that is not as it was."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from actuated_characters.sweep.draws import is_chosen
from actuated_characters.sweep.journal import Done
from actuated_characters.sweep.row import RowTask
from actuated_characters.sweep.work import Workers, compared
from actuated_characters.trial.results import Result
from msgs_config.errors import ConfigurationError
from msgs_config.versions import installed_versions

_SEED = 0  # of which rows are among a share


def chosen_rows(done: Mapping[int, Done], numbers: Sequence[int], share: float) -> list[int]:
    """The rows to run once more: those of the numbers, or a share of all, one at least.

    Raises:
        ConfigurationError: a row is not among those that are done.
    """
    for number in numbers:
        if number not in done:
            raise ConfigurationError(f"--row {number}: the result has rows {_listed(sorted(done))}")
    if numbers:
        return sorted(set(numbers))
    chosen = [number for number in sorted(done) if is_chosen(_SEED, number, share)]
    return chosen or sorted(done)[:1]


def verify(
    tasks: Sequence[RowTask],
    done: Mapping[int, Done],
    workers: Workers,
    progress: Callable[[], object],
) -> dict[int, str]:
    """Run rows once more; what there is to say of each, empty if it is as it was.

    Raises:
        RunError: no more answers will come.
    """
    waiting, asked, found = list(reversed(tasks)), 0, dict[int, str]()
    while waiting or asked:
        while waiting and asked < workers.size():
            workers.submit(waiting.pop())
            asked += 1
        answer = workers.wait()
        asked -= 1
        number = answer.task.number
        if answer.outcome is None:
            found[number] = f"could not be run: {answer.failure}"
        else:
            again = Done(number, answer.outcome, answer.by)
            told = compared(_without_words(done[number]), _without_words(again))
            found[number] = told.difference and f"differs: {told.difference}"
        progress()
    return dict(sorted(found.items()))


def _without_words(done: Done) -> Done:
    """A row whose error says no more than that there is one: its words are the controller's own."""
    error = "some" if done.outcome.error else ""
    return replace(done, outcome=replace(done.outcome, error=error))


def changes(result: Result, digests: Mapping[str, str]) -> list[str]:
    """What is otherwise than where a result was made: files of the controller, and versions."""
    files = [
        f"the controller's file {name} is another one now"
        for name, digest in result.digests.items()
        if digests.get(name) != digest
    ]
    present = installed_versions()
    versions = [
        f"{name} was {before} there, and is {present.get(name, 'not installed')}"
        for name, before in result.versions.items()
        if present.get(name) != before
    ]
    return [*files, *versions]


def _listed(numbers: Sequence[int]) -> str:
    return f"{numbers[0]} to {numbers[-1]}" if numbers else "none"
