"""The fewest and smallest of some inputs with which something still fails.

It knows inputs by their numbers alone, and asks which of some choices of them is the first that
fails, so that several can be tried at once. Failing need not be monotone: less may fail where more
does not. Source of `ddmin`: Zeller and Hildebrandt 2002, "Simplifying and Isolating
Failure-Inducing Input".
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise
from typing import TypeAlias, TypeVar

Sizes: TypeAlias = Mapping[int, float]
"""The inputs that are kept by their numbers, each with its size: 1 as it was, 0 nothing of it."""

SHARE = 0.05
"""By which share less of an input no longer fails."""

_LEAST = 1e-3  # size of which no less is tried, should all fail
_DIGITS = 4  # of a size between two others
_MOST_PAIRS = 120  # that are tried, those of 16 inputs
_T = TypeVar("_T")
First: TypeAlias = Callable[[Sequence[_T]], int | None]
"""Of choices, the place of the first one that fails; None if none does."""


def shrunk(order: Sequence[int], scalable: Collection[int], first: First[Sizes]) -> Sizes:
    """The fewest and then the smallest inputs that still fail; all of them must fail together.

    Without each of those the others do not fail, nor do they with `SHARE` less of one of those that
    are `scalable`. They are tried in an order; the first ones are the likeliest.
    """

    def first_as_they_are(choices: Sequence[Sequence[int]]) -> int | None:
        return first([dict.fromkeys(numbers, 1.0) for numbers in choices])

    kept: Sizes = dict.fromkeys(fewest(order, first_as_they_are), 1.0)
    tried, before = set[int](), None
    while kept != before:
        before = kept
        for number in [each for each in kept if each in scalable]:
            smaller = {**kept, number: (1.0 - SHARE) * kept[number]}
            if number not in tried or first([smaller]) is not None:
                kept = _with_smallest(kept, number, first)
            tried.add(number)
        kept = _without_needless(kept, first)
    return kept


def _with_smallest(kept: Sizes, number: int, first: First[Sizes]) -> Sizes:
    """The same inputs with one of them as small as it can be."""

    def first_size(sizes: Sequence[float]) -> int | None:
        return first([{**kept, number: size} for size in sizes])

    size = smallest_size(first_size, kept[number])
    return {**kept, number: size}


def _without_needless(kept: Sizes, first: First[Sizes]) -> Sizes:
    """The same inputs without those that the others fail without."""
    rests = [{each: kept[each] for each in kept if each != number} for number in kept]
    found = first(rests)
    return kept if found is None else _without_needless(rests[found], first)


def fewest(items: Sequence[_T], first: First[Sequence[_T]]) -> Sequence[_T]:
    """Few items that fail: none, one or two if any do, else a subset none of which can be left out.

    Of more than 16 items not all pairs are tried.
    """
    few: list[Sequence[_T]] = [(), *((item,) for item in items)]
    if (found := first(few)) is not None:
        return few[found]
    left = ddmin(items, first)
    if len(left) <= 2:
        return left
    gaps = range(1, len(items))  # those next to each other are the likeliest to act together
    pairs = [pair for gap in gaps for pair in zip(items, items[gap:], strict=False)][:_MOST_PAIRS]
    found = first(pairs)
    return left if found is None else pairs[found]


def ddmin(items: Sequence[_T], first: First[Sequence[_T]]) -> Sequence[_T]:
    """Of items that fail together some that do, and do not without any one of them.

    Of an empty choice it is not asked.
    """
    parts = 2
    while len(items) > 1:
        found = _failing_part(items, parts, first)
        if found is not None:
            items, parts = found
        elif parts == len(items):
            break
        else:
            parts = min(2 * parts, len(items))
    return items


def _failing_part(
    items: Sequence[_T], parts: int, first: First[Sequence[_T]]
) -> tuple[Sequence[_T], int] | None:
    """A part of so many that fails, or all but one, and its number of parts; else None."""
    bounds = [len(items) * part // parts for part in range(parts + 1)]
    cuts = list(pairwise(bounds))
    chosen = [items[begin:end] for begin, end in cuts]
    rests = [[*items[:begin], *items[end:]] for begin, end in cuts] if parts > 2 else []
    choices = [*chosen, *rests]
    found = first(choices)
    if found is None:
        return None
    return choices[found], 2 if found < len(chosen) else parts - 1


def smallest_size(first: First[float], size: float) -> float:
    """A size of which `SHARE` less does not fail, at most a given one, which does.

    It asks about two sizes at once, which part in three what lies between the least that fails and
    what does not, to begin with nothing. Less than a thousandth is not tried.
    """
    below = 0.0  # does not fail
    while size > _LEAST:
        smaller = (1.0 - SHARE) * size
        one, two = (_rounded(below + share * (size - below)) for share in (1.0 / 3.0, 2.0 / 3.0))
        probes = [smaller] if below >= (1.0 - 2.0 * SHARE) * size else [one, min(two, smaller)]
        found = first(probes)
        if found is not None:
            below, size = (below, *probes)[found], probes[found]
        elif probes[-1] == smaller:
            break
        else:
            below = probes[-1]
    return size


def _rounded(size: float) -> float:
    """A size that is shorter to write."""
    return float(f"{size:.{_DIGITS}g}")
