"""The soak in short: what `make soak` does for half a million ticks."""

import itertools
import re

import pytest

from msgs_config.bus.polling import DirectSubscription
from msgs_config.messages.clock import TickClock
from msgs_config.messages.topic import STREAM
from tests.endurance import soak as soak_module
from tests.endurance import soak_report
from tests.endurance.soak import soak


@pytest.mark.nightly
@pytest.mark.slow
def test_no_tick_is_lost_and_no_memory_grows_whatever_disturbs(
    domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    del domain  # the processes inherit it
    # A publisher keeps what a reader of a busy machine has not taken yet, up to its depth.
    settled = STREAM.depth + 1_000
    monkeypatch.setattr(soak_report, "SETTLED", settled)
    for module in (soak_module, soak_report):
        monkeypatch.setattr(module, "MEMORY_PERIOD", 500)

    found = soak(settled + 3_000, seed=2, progress=lambda tick: None)

    assert found.problems == []
    assert found.ticks == settled + 3_000
    assert all(len(samples) == 19 for samples in found.megabytes.values())
    assert set(found.growth) == {"sim_node", "controller_node"}
    assert set(found.disturbances) == {"push", "pause", "reset", "set_gain", "set_duration"}


@pytest.mark.slow
def test_a_tick_that_is_lost_is_found(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    del domain

    class Leaky(DirectSubscription):
        """Loses the 300th message that it takes."""

        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)
            self._taken = itertools.count(1)

        def take(self) -> bytes | None:
            raw = super().take()
            return super().take() if raw is not None and next(self._taken) == 300 else raw

    monkeypatch.setattr(soak_module, "DirectSubscription", Leaky)

    found = soak(600, seed=2, progress=lambda tick: None)

    (problem,) = found.problems
    told = re.fullmatch(r"after tick (\d+) comes (\d+) ns", problem)
    assert told is not None
    tick = int(told[1])  # the first state may have come more than once
    assert 200 < tick < 300
    assert int(told[2]) == TickClock(240).stamp_ns(tick + 2)
