"""Sampling-based motion control: window by window, offsets are sampled, simulated and chosen.

Source: Liu, Yin, van de Panne, Shao and Xu 2010, "Sampling-based Contact-rich Motion Control".
Ours are the look ahead, the second round of samples around the best ones of the first, and the
way back.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from experiment.samcon.rollout import Expansion, Rollout
from experiment.samcon.settings import Settings
from experiment.samcon.tree import Node, chosen, prune
from experiment.samcon.workers import Workers
from msgs_config.arrays import FloatArray, IntArray

_GOOD = 0.4  # share of the samples that are not lost from which some are kept
_ELITE = 0.1  # share of the first round around which the second one is drawn
_PLAIN = 0.1  # of what is kept, samples without a correction
_NARROW = 0.3  # of the noise, in the second round
_WORST = 150.0  # cost of a state ahead, which may still be mended
_FURTHEST_BACK = 32  # windows
_REACH = _FURTHEST_BACK + 2  # windows back of which snapshots are kept


@dataclass
class Progress:
    """Where a search is; all that it needs to go on, beside its problem and settings."""

    levels: list[list[Node]]  # of each window's kept nodes, after the first state
    failures: int = 0  # windows of which all samples were lost
    stuck: int = 0  # of these, since the furthest window was reached
    best: Node | None = None  # of the furthest window that was reached
    samples: int = 0  # simulated so far

    @property
    def window(self) -> int:
        """The window that comes next."""
        return len(self.levels) - 1


@dataclass(frozen=True)
class Failure:
    """Why a search ended before the last window."""

    window: int
    costs: tuple[float, ...]  # of its best samples; infinite: all were lost


def first_progress(rollout: Rollout) -> Progress:
    """A search that has not begun."""
    return Progress([[Node(None, np.zeros(rollout.layout.size))]])


def search(
    rollout: Rollout,
    workers: Workers,
    settings: Settings,
    progress: Progress,
    report: Callable[[Progress], None],
) -> Failure | None:
    """Go on to the last window, or until it is stuck; None if all went well.

    Where all samples of a window are lost it goes back, twice as far each time (at most 32
    windows) until it gets further than ever: a walker that is going to fall has long been beyond
    help when it does.

    Raises:
        ActuatedCharactersError: a worker failed.
    """
    steps = _Steps(rollout, workers, settings)
    while progress.window < len(rollout.windows):
        window = progress.window
        nodes = steps.next_level(progress)
        if nodes:
            progress.levels.append(nodes)
            best = min(nodes, key=lambda node: node.cost)
            furthest = 0 if progress.best is None else len(progress.best.path)
            if window + 1 > furthest:
                progress.stuck = 0
            if window + 1 >= furthest:
                progress.best = best
            prune(progress.levels, _REACH)
        else:
            progress.failures += 1
            progress.stuck += 1
            if progress.stuck >= settings.tries:
                return Failure(window, steps.last_costs)
            back = min(2**progress.stuck, _FURTHEST_BACK, window)
            del progress.levels[window + 1 - back :]
        report(progress)
    return None


def result(progress: Progress, workers: Workers) -> Node:
    """The best path that was found: of the last level, the one of least mean cost.

    If the search has gone back, it is that of the furthest window. Its last state is simulated
    again on the way from the first one.
    """
    level = progress.levels[-1]
    best = min(level, key=lambda node: float(np.mean([step.cost for step in node.path] or [0.0])))
    if progress.best is not None and len(progress.best.path) > progress.window:
        best = progress.best
    (again,) = workers.expand([best.branch(np.zeros((0, len(best.offset))))])
    best.end = again.start
    return best


@dataclass(frozen=True)
class _Samples:
    """Samples of a window that were simulated."""

    owners: IntArray  # (s,) indices of their parents
    offsets: FloatArray  # (s, n)
    ends: FloatArray  # (s, f) features
    costs: FloatArray  # (s,)

    def and_those(self, other: "_Samples") -> "_Samples":
        """These, and then the others."""
        return _Samples(
            np.concatenate((self.owners, other.owners)),
            np.vstack((self.offsets, other.offsets)),
            np.vstack((self.ends, other.ends)),
            np.concatenate((self.costs, other.costs)),
        )

    def node(self, parents: Sequence[Node], index: int) -> Node:
        """The state that a sample has led to."""
        parent, end = parents[self.owners[index]], self.ends[index]
        return Node(parent, self.offsets[index], float(self.costs[index]), end)


class _Steps:
    """Makes one level of the tree from the one before."""

    def __init__(self, rollout: Rollout, workers: Workers, settings: Settings) -> None:
        self._rollout, self._workers, self._settings = rollout, workers, settings
        self._noise = settings.largest_offsets(rollout.layout)
        self._corrected: IntArray = np.flatnonzero(self._noise)
        self.last_costs: tuple[float, ...] = ()

    def next_level(self, progress: Progress) -> list[Node]:
        """The nodes that are kept of the next window; none if all samples are lost."""
        window, settings = progress.window, self._settings
        seed = [settings.seed, window, progress.failures]
        rng = np.random.default_rng(np.random.SeedSequence(seed))
        refined = int(settings.refined * settings.samples)
        broad = max(settings.samples - refined, 1)
        parents = self._some(progress.levels[-1], broad)
        owners = np.arange(broad) * len(parents) // broad
        offsets = self._drawn(rng, broad) + self._rollout.plain(window)
        plain = np.flatnonzero(np.diff(owners, prepend=-1))
        offsets[plain] = self._rollout.plain(window)  # each goes on without a correction, too
        samples = self._tried(window, parents, owners, offsets)
        elite = chosen(samples.costs, max(int(_ELITE * broad), 1), 0.0)
        if refined and elite:
            around = np.array([elite[index % len(elite)] for index in range(refined)])
            more = offsets[around] + _NARROW * self._drawn(rng, refined)
            order = np.argsort(owners[around], kind="stable")
            second = self._tried(window, parents, owners[around][order], more[order])
            samples = samples.and_those(second)
        progress.samples += len(samples.costs)
        self.last_costs = tuple(np.sort(samples.costs)[:5].tolist())
        picked = set(chosen(samples.costs, settings.kept, _GOOD))
        picked |= set(self._plain(parents, samples, plain))
        return [
            samples.node(parents, index)
            for index in sorted(picked, key=lambda index: (samples.costs[index], index))
        ]

    def _plain(self, parents: Sequence[Node], samples: "_Samples", plain: IntArray) -> list[int]:
        """The samples without a correction that are kept: what the feedback alone can do.

        The best ones, and the one that has never been corrected: feedback may well bring it to the
        end where what looks better now leads out of its reach.
        """
        sound = [int(index) for index in plain if np.isfinite(samples.costs[index])]
        sound.sort(key=lambda index: (samples.costs[index], index))
        never = [i for i in sound if self._is_plain(parents[samples.owners[i]])]
        return sound[: max(int(_PLAIN * self._settings.kept), 1)] + never

    def _some(self, nodes: list[Node], count: int) -> list[Node]:
        """At most so many of the nodes, good ones and bad ones; who was never corrected is in."""
        if len(nodes) <= count:
            return nodes
        some = [nodes[index * len(nodes) // count] for index in range(count)]
        never = [node for node in nodes if self._is_plain(node)]
        some = [node for node in some if all(node is not other for other in never)]
        return [*some[: count - len(never)], *never]

    def _is_plain(self, node: Node) -> bool:
        """Whether nothing on the way to a node was a correction."""
        return all(
            np.array_equal(step.offset, self._rollout.plain(window))
            for window, step in enumerate(node.path)
        )

    def _tried(
        self, window: int, parents: Sequence[Node], owners: IntArray, offsets: FloatArray
    ) -> "_Samples":
        ends = self._simulate(parents, owners, offsets)
        return _Samples(owners, offsets, ends[:, 0], self._costs(window, ends))

    def _drawn(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Offsets (s, n): small ones and large ones, of few joints and of many, evenly."""
        offsets = np.zeros((count, len(self._noise)))
        shape = count, len(self._corrected)
        wide = rng.uniform(-1.0, 1.0, shape)
        sizes, shares = rng.uniform(0.0, 1.0, (2, count, 1))
        moved = rng.uniform(0.0, 1.0, shape) < shares
        offsets[:, self._corrected] = moved * sizes * wide * self._noise[self._corrected]
        return offsets

    def _simulate(
        self, parents: Sequence[Node], owners: IntArray, offsets: FloatArray
    ) -> FloatArray:
        """The features (s, 1 + l, f) to which offsets (s, n) lead; their owners are rising."""
        used = sorted(set(owners.tolist()))
        branches = [
            parents[index].branch(offsets[np.flatnonzero(owners == index)]) for index in used
        ]
        expansions: Iterator[Expansion] = self._workers.expand(branches)
        rows: list[FloatArray] = []
        for index, expansion in zip(used, expansions, strict=True):
            parents[index].snapshot, parents[index].end = expansion.snapshot, expansion.start
            rows.append(expansion.features)
        return np.vstack(rows)

    def _costs(self, window: int, ends: FloatArray) -> FloatArray:
        """The costs (s,) of features (s, 1 + l, f): of the window, and of how it goes on."""
        costs = self._rollout.costs(window, ends[:, 0], self._settings)
        beyond = range(window + 1, min(window + ends.shape[1], len(self._rollout.windows)))
        for later in beyond:
            ahead = self._rollout.costs(later, ends[:, later - window], self._settings)
            costs = costs + np.minimum(ahead, _WORST)
        return costs / (1 + len(beyond))
