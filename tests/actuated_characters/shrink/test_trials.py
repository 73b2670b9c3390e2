"""Choices that are tried side by side: what is found does not depend on which ends first."""

import random
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest

from actuated_characters.runs.until_fall import Ended
from actuated_characters.shrink import trials as trials_module
from actuated_characters.shrink.inputs import Event, Setting
from actuated_characters.shrink.minimal import Sizes
from actuated_characters.shrink.trials import Trials
from msgs_config.errors import ActuatedCharactersError, RefusedError, RunError

AT_ONCE = 3
HOLDS, FALLS = Ended(False, None, ()), Ended(True, 5, ())
OUTCOMES = (HOLDS, HOLDS, HOLDS, FALLS, RefusedError("refused"), RunError("a node failed"))


class Inputs:
    """Stands for a shrinking, of inputs that are named by their numbers."""

    def events(self, sizes: Sizes) -> list[Event]:
        return [Event(1, Setting(str(number), size)) for number, size in sizes.items()]


class Pool:
    """Tries what it is given in any order, one choice whenever somebody waits."""

    def __init__(self, outcomes: Sequence[Ended | Exception], rng: random.Random) -> None:
        self.submitted: list[int] = []
        self._outcomes, self._rng = outcomes, rng
        self._of: dict[Future[Ended], int] = {}

    def submit(self, run: Callable[..., Ended], events: Sequence[Event], begin: None) -> Any:
        (event,) = events
        assert isinstance(event.content, Setting)
        future = Future[Ended]()
        self._of[future] = int(event.content.name)
        self.submitted.append(self._of[future])
        return future

    def wait(self, futures: Collection[Future[Ended]], return_when: str) -> None:
        at_work = [future for future in futures if not future.done()]
        assert 0 < len(at_work) <= AT_ONCE + 1
        future = self._rng.choice(at_work)
        outcome = self._outcomes[self._of[future]]
        if isinstance(outcome, Ended):
            future.set_result(outcome)
        else:
            future.set_exception(outcome)


def asked(pool: Pool, count: int, monkeypatch: pytest.MonkeyPatch) -> int | None:
    monkeypatch.setattr(Trials, "__post_init__", lambda self: None)
    monkeypatch.setattr(trials_module, "wait", pool.wait)
    trials = Trials(Inputs(), Path())  # type: ignore[arg-type]
    trials._pool, trials._at_once = pool, AT_ONCE  # type: ignore[assignment]
    return trials.first([{number: 1.0} for number in range(count)])


def one_after_the_other(outcomes: Sequence[Ended | Exception]) -> int | None:
    for number, outcome in enumerate(outcomes):
        if isinstance(outcome, RunError) and not isinstance(outcome, RefusedError):
            raise outcome
        if outcome is FALLS:
            return number
    return None


@pytest.mark.parametrize("seed", range(60))
def test_it_is_the_first_one_that_falls_whichever_ends_first(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    rng = random.Random(seed)
    outcomes = rng.choices(OUTCOMES, k=8)
    pool = Pool(outcomes, rng)
    expected: int | str | None
    try:
        expected = one_after_the_other(outcomes)
    except RunError as error:
        expected = str(error)

    found: int | str | None
    try:
        found = asked(pool, len(outcomes), monkeypatch)
    except ActuatedCharactersError as error:
        found = str(error)

    assert found == expected
    assert len(set(pool.submitted)) == len(pool.submitted)


def test_a_process_that_was_killed_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    pool = Pool([HOLDS, BrokenProcessPool()], random.Random(0))

    with pytest.raises(RunError, match="was killed; begin again"):
        asked(pool, 2, monkeypatch)


def test_what_is_not_needed_is_not_tried_where_one_falls(monkeypatch: pytest.MonkeyPatch) -> None:
    pool = Pool([FALLS] * 20, random.Random(0))

    assert asked(pool, 20, monkeypatch) == 0
    assert len(pool.submitted) <= AT_ONCE + 1
