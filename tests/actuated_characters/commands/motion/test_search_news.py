"""What a page is told of a search, by the real search with the real engine."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.commands.motion.search_news import found_news, wanted_news, window_news
from actuated_characters.reconstruction.problem import Problem
from actuated_characters.reconstruction.reconstruction import Job, Reconstruction, reconstruct
from actuated_characters.reconstruction.search import Progress, SearchSettings
from actuated_characters.runs.plan import RunPlan
from actuated_characters.viewer.search.news import Fate, WindowNews

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

QUICK = {"plan.samples": 8, "plan.rounds": 1, "plan.horizon": 0.2}
PROBLEM = Problem("humanoid", "kick", 0.6, {}, QUICK)
TICKS, WINDOW, BEFORE = 144, 48, 48  # BEFORE: 0.2 s, from which on worlds are seen
WORLDS, KEPT = 4, 2

Seen = tuple[RunPlan, list[WindowNews], Reconstruction]


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    plan, told = PROBLEM.plan(), list[WindowNews]()

    def report(progress: Progress, windows: int) -> None:
        if progress.tried:
            told.append(window_news(plan, progress, windows))

    settings = SearchSettings(WORLDS, KEPT, 0.2)
    file = tmp_path_factory.mktemp("search") / "kick.json"
    return plan, told, reconstruct(Job(PROBLEM, settings, file), report)


def test_it_is_told_of_each_window_and_of_the_fate_of_each_world(seen: Seen) -> None:
    _, told, _ = seen

    assert [(each.number, each.windows) for each in told] == [(1, 3), (2, 3), (3, 3)]
    assert [each.time for each in told] == pytest.approx([0.2, 0.4, 0.6])
    for each in told:
        fates = [world.fate for world in each.worlds]
        assert len(fates) == WORLDS
        assert (fates.count(Fate.BEST), fates.count(Fate.KEPT)) == (1, KEPT - 1)
        costs = {world.fate: world.cost for world in each.worlds}
        assert costs[Fate.BEST] == min(world.cost for world in each.worlds if world.cost)


def test_a_world_is_seen_from_a_while_before_its_window_on(seen: Seen) -> None:
    _, (first, second, third), _ = seen

    assert {len(world.positions) for world in first.worlds} == {WINDOW + 1}
    for each in (second, third):
        assert {len(world.positions) for world in each.worlds} == {BEFORE + WINDOW + 1}
    starts = {world.positions[BEFORE].tobytes() for world in third.worlds}
    kept = {
        world.positions[-1].tobytes()
        for world in second.worlds
        if world.fate in (Fate.BEST, Fate.KEPT)
    }
    assert starts == kept


def test_the_best_path_goes_to_the_end_of_the_best_world(seen: Seen) -> None:
    plan, told, found = seen

    for each in told:
        (best,) = (world for world in each.worlds if world.fate is Fate.BEST)
        assert np.array_equal(each.best[-1], best.positions[-1])
        assert len(each.best) == WINDOW * each.number + 1
        assert each.desired.shape == each.best.shape
    assert np.array_equal(told[-1].desired[1:], found.desired)
    assert np.array_equal(wanted_news(plan).positions[1:], found.desired[:-1])


def test_what_was_found_is_a_path_of_the_last_windows_kept_worlds(seen: Seen) -> None:
    _, told, found = seen

    news = found_news(found)
    kept = [world for world in told[-1].worlds if world.fate in (Fate.BEST, Fate.KEPT)]
    assert len(news.positions) == TICKS
    assert any(np.array_equal(news.positions[-1], world.positions[-1]) for world in kept)


def test_worlds_that_are_lost_are_told_of_with_their_motion(tmp_path: Path) -> None:
    problem = Problem("humanoid", "kick", 0.4, {}, QUICK, ("root:0,0,100000@0.25",))
    plan, told = problem.plan(), list[WindowNews]()

    def report(progress: Progress, windows: int) -> None:
        if progress.tried:
            told.append(window_news(plan, progress, windows))
        if progress.failures:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct(Job(problem, SearchSettings(2, 1, 0.2), tmp_path / "kick.json"), report)

    last = told[-1]
    assert (last.number, last.failures) == (2, 1)
    assert {world.fate for world in last.worlds} == {Fate.LOST}
    assert all(len(world.positions) > BEFORE for world in last.worlds)


def test_of_many_worlds_the_kept_ones_and_others_are_shown(seen: Seen, tmp_path: Path) -> None:
    del seen
    problem = Problem("humanoid", "kick", 0.05, {}, QUICK)
    plan, told = problem.plan(), list[WindowNews]()

    def report(progress: Progress, windows: int) -> None:
        if progress.tried:
            told.append(window_news(plan, progress, windows))

    reconstruct(Job(problem, SearchSettings(14, 3, 0.05), tmp_path / "kick.json"), report)

    (only,) = told
    assert (len(only.worlds), only.hidden) == (12, 2)
    assert [world.fate for world in only.worlds].count(Fate.DROPPED) == 9


def test_of_a_search_that_is_resumed_what_it_does_from_then_on_is_seen(tmp_path: Path) -> None:
    plan, told = PROBLEM.plan(), list[WindowNews]()
    job = Job(PROBLEM, SearchSettings(2, 1, 0.2), tmp_path / "kick.json")

    def interrupt(progress: Progress, windows: int) -> None:
        del windows
        if progress.window == 1:
            raise KeyboardInterrupt

    def report(progress: Progress, windows: int) -> None:
        if progress.tried:
            told.append(window_news(plan, progress, windows))

    with pytest.raises(KeyboardInterrupt):
        reconstruct(job, interrupt)
    reconstruct(replace(job, resume=True), report)

    assert [each.number for each in told] == [2, 3]
    assert {len(world.positions) for world in told[0].worlds} == {WINDOW + 1}
    assert {len(world.positions) for world in told[1].worlds} == {BEFORE + WINDOW + 1}
    assert [len(each.best) for each in told] == [WINDOW + 1, 2 * WINDOW + 1]
