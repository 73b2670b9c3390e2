"""The fewest and smallest of some inputs with which something still fails.

It knows inputs by their numbers alone, and asks a predicate about choices of them. The predicate
need not be monotone: less may fail where more does not. Source of `ddmin`: Zeller and Hildebrandt
2002, "Simplifying and Isolating Failure-Inducing Input".
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import combinations, pairwise
from typing import TypeAlias, TypeVar

Sizes: TypeAlias = Mapping[int, float]
"""The inputs that are kept by their numbers, each with its size: 1 as it was, 0 nothing of it."""

SHARE = 0.05
"""By which share less of an input no longer fails."""

_LEAST = 1e-3  # size of which no less is tried, should all fail
_DIGITS = 4  # of a size between two others
_MOST_PAIRS = 120  # that are tried, those of 16 inputs
_T = TypeVar("_T")


def shrunk(
    order: Sequence[int], scalable: Collection[int], fails: Callable[[Sizes], bool]
) -> Sizes:
    """The fewest and then the smallest inputs that still fail; all of them must fail together.

    Without each of those the others do not fail, nor do they with `SHARE` less of one of those that
    are `scalable`. They are tried in an order; the first ones are the likeliest.
    """

    def fails_as_they_are(numbers: Sequence[int]) -> bool:
        return fails(dict.fromkeys(numbers, 1.0))

    kept: Sizes = dict.fromkeys(fewest(order, fails_as_they_are), 1.0)
    tried, before = set[int](), None
    while kept != before:
        before = kept
        for number in [each for each in kept if each in scalable]:
            smaller = {**kept, number: (1.0 - SHARE) * kept[number]}
            if number not in tried or fails(smaller):
                kept = _with_smallest(kept, number, fails)
            tried.add(number)
        kept = _without_needless(kept, fails)
    return kept


def _with_smallest(kept: Sizes, number: int, fails: Callable[[Sizes], bool]) -> Sizes:
    """The same inputs with one of them as small as it can be."""
    size = smallest_size(lambda size: fails({**kept, number: size}), kept[number])
    return {**kept, number: size}


def _without_needless(kept: Sizes, fails: Callable[[Sizes], bool]) -> Sizes:
    """The same inputs without those that the others fail without."""
    for number in kept:
        rest = {each: size for each, size in kept.items() if each != number}
        if fails(rest):
            return _without_needless(rest, fails)
    return kept


def fewest(items: Sequence[_T], fails: Callable[[Sequence[_T]], bool]) -> Sequence[_T]:
    """Few items that fail: none, one or two if any do, else a subset none of which can be left out.

    Of more than 16 items not all pairs are tried.
    """
    if fails(()):
        return ()
    for item in items:
        if fails((item,)):
            return (item,)
    left = ddmin(items, fails)
    if len(left) > 2:
        for pair in list(combinations(items, 2))[:_MOST_PAIRS]:
            if fails(pair):
                return pair
    return left


def ddmin(items: Sequence[_T], fails: Callable[[Sequence[_T]], bool]) -> Sequence[_T]:
    """Of items that fail together some that do, and do not without any one of them.

    Of an empty choice it is not asked.
    """
    parts = 2
    while len(items) > 1:
        found = _failing_part(items, parts, fails)
        if found is not None:
            items, parts = found
        elif parts == len(items):
            break
        else:
            parts = min(2 * parts, len(items))
    return items


def _failing_part(
    items: Sequence[_T], parts: int, fails: Callable[[Sequence[_T]], bool]
) -> tuple[Sequence[_T], int] | None:
    """A part of so many that fails, or all but one, and its number of parts; else None."""
    bounds = [len(items) * part // parts for part in range(parts + 1)]
    cuts = list(pairwise(bounds))
    for begin, end in cuts:
        if fails(items[begin:end]):
            return items[begin:end], 2
    for begin, end in cuts if parts > 2 else ():
        rest = [*items[:begin], *items[end:]]
        if fails(rest):
            return rest, parts - 1
    return None


def smallest_size(fails: Callable[[float], bool], size: float) -> float:
    """A size of which `SHARE` less does not fail, at most a given one, which does.

    It halves what lies between the least that fails and what does not, to begin with nothing. Less
    than a thousandth is not tried.
    """
    below = 0.0  # does not fail
    while size > _LEAST:
        smaller = (1.0 - SHARE) * size
        half = float(f"{0.5 * (below + size):.{_DIGITS}g}")  # which is shorter to write
        probe = smaller if below >= (1.0 - 2.0 * SHARE) * size else half
        if fails(probe):
            size = probe
        elif probe == smaller:
            break
        else:
            below = probe
    return size
