"""An observation, made of its terms: each clipped and scaled, with those of decisions before."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controller_node.behaviours.onnx_policy.description import Description, History, UsedTerm
from controller_node.behaviours.onnx_policy.terms import Situation
from msgs_config.arrays import FloatArray, SingleArray


def frame_of(terms: Sequence[UsedTerm], seen: Situation) -> list[FloatArray]:
    """The present entries of each term (s,): clipped first, then scaled, as Isaac Lab does."""
    return [_present(used, seen) for used in terms]


def _present(used: UsedTerm, seen: Situation) -> FloatArray:
    values = used.term.compute(seen, used.options)
    if used.clip is not None:
        values = np.clip(values, *used.clip)
    return values * used.scale


class ObservationHistory:
    """Remembers as many frames of each term as the policy is told."""

    def __init__(self, terms: Sequence[UsedTerm], history: History) -> None:
        self._terms, self._history = terms, history
        self._past: list[FloatArray] = []  # (frames, s) of each term, the oldest first

    def add(self, frame: Sequence[FloatArray]) -> SingleArray:
        """Take the present frame; the observation (o,)."""
        if not self._past:
            repeats = self._history.start == "repeat"
            self._past = [
                np.tile(now if repeats else np.zeros_like(now), (used.history, 1))
                for used, now in zip(self._terms, frame, strict=True)
            ]
        for row, now in enumerate(frame):
            self._past[row] = np.concatenate((self._past[row][1:], now[np.newaxis]))
        return arranged(self._past, self._history).astype(np.float32)


def arranged(past: Sequence[FloatArray], history: History) -> FloatArray:
    """The entries (o,) of all terms, of each one's frames (f, s), the oldest first."""
    if history.order == "newest_first":
        past = [frames[::-1] for frames in past]
    if history.by == "frame":
        past = [np.concatenate(past, axis=1)]
    return np.concatenate([frames.ravel() for frames in past])


class Entry(NamedTuple):
    """What an entry of an observation is."""

    used: UsedTerm
    column: int  # among the term's own entries
    age: int  # decisions ago


def entries_of(policy: Description) -> list[Entry]:
    """What each entry of a policy's observation is, in their order."""
    every, codes, history = list[Entry](), [], policy.history
    for used in policy.terms:
        size, first = len(used.labels), len(every)
        for age in range(used.history - 1, -1, -1):
            every += [Entry(used, column, age) for column in range(size)]
        codes.append(np.arange(first, len(every), dtype=float).reshape(used.history, size))
    return [every[int(code)] for code in arranged(codes, history)]
