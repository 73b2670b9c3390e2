"""What a page shows of a search, made from where the search is."""

from collections.abc import Iterable

import numpy as np

from actuated_characters.reconstruction.reconstruction import Reconstruction
from actuated_characters.reconstruction.search import Progress, Tried, value
from actuated_characters.reconstruction.tree import Node
from actuated_characters.runs.plan import RunPlan
from actuated_characters.viewer.search.news import Fate, MotionNews, WindowNews, WorldNews
from msgs_config.arrays import FloatArray
from msgs_config.messages.clock import TickClock

_BEFORE = 0.2  # s before a window from which on its worlds are seen
_WANTED = 10.0  # s of the captured motion that are seen at first
_BEST = 2.0  # s of the best path that are seen
_MOST_WORLDS = 12  # worlds that are seen of a window


def window_news(plan: RunPlan, progress: Progress, windows: int) -> WindowNews:
    """The window that was tried last; `plan` is of the search's problem."""
    rate, first = plan.simulation.rate_hz, progress.tried[0].parent
    shown = _most_telling(progress.tried)
    worlds = tuple(_world(each, round(_BEFORE * rate)) for each in shown)
    best = _positions(progress.best, round(_BEST * rate))
    return WindowNews(
        number=1 if first is None else len(first.path) + 1,
        windows=windows,
        time=max(_tick(each) for each in progress.tried) / rate,
        failures=progress.failures,
        worlds=worlds,
        hidden=len(progress.tried) - len(shown),
        best=best,
        desired=_desired(plan, progress.best, len(best)),
    )


def wanted_news(plan: RunPlan) -> MotionNews:
    """The captured motion itself, before anything is tried."""
    positions = _desired_at(plan, range(min(plan.ticks, round(_WANTED * plan.simulation.rate_hz))))
    about = "this is wanted. The first window is being tried."
    return MotionNews(positions, None, "the captured motion", about)


def found_news(found: Reconstruction) -> MotionNews:
    """What was found."""
    metrics = found.metrics
    about = (
        f"found, by joint torques alone. Its centre of mass is {metrics.centre_error_mean_m:.3f} m "
        f"from the captured one's, its joints {metrics.joint_error_mean_rad:.3f} rad, on average."
    )
    return MotionNews(found.positions, found.desired, "the one that stays", about)


def _most_telling(tried: tuple[Tried, ...]) -> list[Tried]:
    """As many worlds as are seen, in their order: the kept ones, lost ones, and then others."""

    def importance(each: Tried) -> int:
        if each.rank is not None:
            return each.rank
        return len(tried) + (each.node is not None)

    chosen = sorted(tried, key=importance)[:_MOST_WORLDS]
    return [each for each in tried if any(each is other for other in chosen)]


def _world(tried: Tried, before: int) -> WorldNews:
    lead = _positions(tried.parent, before + 1)[:-1]  # its end is the first state of the window
    positions = np.concatenate((lead, tried.motion)) if len(lead) else tried.motion
    if tried.node is None:
        return WorldNews(positions, Fate.LOST, None)
    fate = {None: Fate.DROPPED, 0: Fate.BEST}.get(tried.rank, Fate.KEPT)
    return WorldNews(positions, fate, value(tried.node))


def _tick(tried: Tried) -> int:
    """The tick at the end of a world."""
    if tried.node is not None:
        return tried.node.tick
    return (0 if tried.parent is None else tried.parent.tick) + len(tried.motion) - 1


def _positions(node: Node | None, most: int) -> FloatArray:
    """The last positions (t, n) on the way to a node, one for each tick, at most so many.

    Of nodes that a resumed search was begun with the ends alone are known: there it begins.
    """
    parts: list[FloatArray] = []
    while node is not None and sum(map(len, parts)) < most:
        begins = node.parent is None or len(node.motion) == 1
        parts.append(node.motion if begins else node.motion[1:])
        node = None if begins else node.parent
    return np.concatenate(parts[::-1])[-most:] if parts else np.empty((0, 0))


def _desired(plan: RunPlan, best: Node | None, count: int) -> FloatArray:
    """The motion's own positions (count, n) at the last ticks on the way to a node."""
    if best is None or not count:
        return np.empty((0, 0))
    return _desired_at(plan, range(best.tick - count + 1, best.tick + 1))


def _desired_at(plan: RunPlan, ticks: Iterable[int]) -> FloatArray:
    """The motion's own positions (t, n) at ticks."""
    clock = TickClock(plan.simulation.rate_hz)
    times = [clock.time_after(tick) for tick in ticks]
    return np.array([plan.reference.sample(time).configuration.position for time in times])
