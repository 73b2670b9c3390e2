"""An observation, made of its terms: each clipped and scaled, with those of decisions before."""

from collections.abc import Sequence

import numpy as np

from controller_node.behaviours.onnx_policy.description import History, UsedTerm
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
        ordered = self._past
        if self._history.order == "newest_first":
            ordered = [past[::-1] for past in ordered]
        if self._history.by == "frame":
            ordered = [np.concatenate(ordered, axis=1)]
        return np.concatenate([past.ravel() for past in ordered]).astype(np.float32)
