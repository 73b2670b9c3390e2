"""Lab 5: a hop by sampling-based control: SAMCON (slide 71; Liu et al. 2010)."""

from functools import partial
from typing import NamedTuple

import numpy as np

from lecture.labs.hidden import uniform
from lecture.labs.hopper import FOOT, JOINTS, WINDOW, advance, errors, hop, hopper, worlds
from lecture.labs.sheet import Measured, Sheet
from lecture.labs.simulated import RATE
from lecture.labs.student import Student
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character

TITLE = "a hop by SAMCON"

_LAB = 5
_SAMPLES, _KEPT = 300, 60
_SPREAD = 0.6  # rad
_NEAR = 0.3  # m, of the centre of mass to the reference's
_GOOD = 0.4  # share of the samples that survivors are chosen from
_EXACT = 1e-3
_COST_GRID = 2.0**-24
_PARTS = ("joints", "foot", "centre", "centre_velocity")
_SIZES = (3, 3, 2, 2)


def grade(student: Student, sheet: Sheet) -> None:
    """Ask for SAMCON's parts, and then have it find hops."""
    sheet.judge("samples, hidden", 10, "± 0.1 %", partial(_draws, student))
    sheet.judge("the cost, hidden errors", 10, "each error costs", partial(_costs, student))
    for case, (samples, kept) in enumerate(((200, 20), (90, 12)), start=1):
        measure = partial(_keeps, student, case, samples, kept)
        sheet.judge(f"survivors, hidden {case}", 10, "good and diverse", measure)
    sheet.judge("the path back, hidden", 10, "each sample", partial(_goes_back, student))
    near = f"centre of mass ± {_NEAR:g} m"
    sheet.judge("hops", 20, near, partial(_hops, student, sheet, 0))
    sheet.judge("hidden random numbers", 10, near, partial(_hops, student, sheet, 1))
    (factor,) = uniform(_LAB, 20, (0.9, 1.1))
    sheet.judge("hidden mass", 10, near, partial(_hops, student, sheet, 2, factor))
    (speed,) = uniform(_LAB, 21, (1.05, 1.15))
    sheet.judge("hidden speed", 10, near, partial(_hops, student, sheet, 3, speed=speed))


def _draws(student: Student) -> Measured:
    *reference, spread = uniform(_LAB, 1, *[(-1.0, 1.0)] * JOINTS, (0.2, 0.8))
    numbers = np.array(uniform(_LAB, 2, *[(0.0, 1.0)] * (8 * JOINTS))).reshape(8, JOINTS)
    found = student.call("draw", np.array(reference), numbers, spread, shape=numbers.shape)
    exact = np.array(reference) + spread * (2.0 * numbers - 1.0)
    off = float(np.abs(found - exact).max() / np.abs(exact).max())
    return Measured(off <= _EXACT, f"{100.0 * off:.2f} % off")


def _costs(student: Student) -> Measured:
    """No error costs least; a part's errors cost more, either way, and more if they grow."""
    sizes = np.array([0.0, 1.0, 2.0, -1.0, -2.0])
    for case, (part, size) in enumerate(zip(_PARTS, _SIZES, strict=True)):
        direction = np.array(uniform(_LAB, 3 + case, *[(0.05, 0.3)] * size))
        given = [np.zeros((len(sizes), each)) for each in _SIZES]
        given[case] = sizes[:, np.newaxis] * direction
        none, *rising = student.call("cost", *given, shape=sizes.shape, grid=_COST_GRID).tolist()
        if not all(none < rising[k] < rising[k + 1] for k in (0, 2)):
            return Measured(False, f"not of {part}")
    return Measured(True, "it does")


def _keeps(student: Student, case: int, samples: int, kept: int) -> Measured:
    """The ranks, 0 the cheapest, are evenly spread over the good ones."""
    costs = np.array(uniform(_LAB, 10 + case, *[(0.0, 50.0)] * samples))
    found = _numbers(student.call("survivors", costs, float(kept), shape=(kept,)), samples)
    if found is None:
        return Measured(False, "no such samples")
    ranks = np.argsort(np.argsort(costs))[found]
    exact = np.arange(kept) * int(_GOOD * samples) // kept
    right = int(np.count_nonzero(np.sort(ranks) == exact))
    return Measured(right == kept, f"{right} of {kept} ranks")


def _goes_back(student: Student) -> Measured:
    windows, samples = 12, 40
    numbers = np.array(uniform(_LAB, 15, *[(0.0, samples)] * ((windows + 1) * samples)))
    drawn = numbers.reshape(windows + 1, samples)
    parents, costs = np.floor(drawn[:-1]), drawn[-1]
    parents[0] = 0.0
    found = student.call("path", parents, costs, shape=(windows,))
    right = int(np.count_nonzero(found == _path(parents.astype(np.intp), int(costs.argmin()))))
    return Measured(right == windows, f"{right} of {windows} samples")


def _path(parents: IntArray, last: int) -> IntArray:
    """The samples (w,) that lead to the last one."""
    samples = [last]
    for row in parents[:0:-1]:
        samples.append(int(row[samples[-1]]))
    return np.array(samples[::-1])


def _numbers(found: FloatArray, count: int) -> IntArray | None:
    """Numbers of samples; None if there is none of such a number."""
    are_whole = (found == np.floor(found)).all()
    return found.astype(np.intp) if are_whole and _within(found, count) else None


def _within(found: FloatArray, count: int) -> bool:
    return bool(found.min() >= 0 and found.max() < count)


class _Found(NamedTuple):
    """What a search has tried."""

    targets: FloatArray  # (w, s, 3), rad
    parents: IntArray  # (w, s), samples of the window before
    costs: FloatArray  # (s,) of the last window
    failure: str  # why it has ended early


def _hops(
    student: Student, sheet: Sheet, case: int, factor: float = 1.0, speed: float = 1.0
) -> Measured:
    """Search, and replay the targets of the path from the first state on."""
    character, reference = hopper(factor), hop(speed)
    found = _search(student, character, reference, case)
    if found.failure:
        return Measured(False, found.failure)
    windows = len(found.targets)
    path = student.call("path", found.parents.astype(float), found.costs, shape=(windows,))
    samples = _numbers(path, _SAMPLES)
    if samples is None:
        return Measured(False, "no such samples")
    return _replay(sheet, character, reference, found.targets[np.arange(windows), samples])


def _search(student: Student, character: Character, reference: FloatArray, case: int) -> _Found:
    """In each window all samples go on from the states that were kept."""
    windows = len(reference) - 1
    model, velocity = DynamicsModel(character), _velocity(reference)
    targets = np.empty((windows, _SAMPLES, JOINTS))
    parents = np.zeros((windows, _SAMPLES), dtype=np.intp)
    costs, kept = np.zeros(_SAMPLES), np.zeros(1, dtype=np.intp)
    with worlds(character, _SAMPLES) as batch:
        start = reference[:1].repeat(_SAMPLES, axis=0)
        batch.reset(position=start, velocity=np.zeros(start.shape))
        for window, desired in enumerate(reference[1:]):
            draw = 1000 * (case + 1) + window
            numbers = np.array(uniform(_LAB, draw, *[(0.0, 1.0)] * (_SAMPLES * JOINTS)))
            drawn = numbers.reshape(_SAMPLES, JOINTS)
            targets[window] = student.call(
                "draw", desired[FOOT:], drawn, _SPREAD, shape=drawn.shape
            )
            parents[window] = kept[np.arange(_SAMPLES) % len(kept)]
            advance(batch, parents[window], targets[window])
            off = errors(model, batch.position, batch.velocity, desired, velocity[window])
            if batch.diverged.any() or off.distances().min() > _NEAR:
                seconds = (window + 1) * WINDOW / RATE
                return _Found(targets, parents, costs, f"all fall within {seconds:.2f} s")
            costs = student.call("cost", *off, shape=(_SAMPLES,), grid=_COST_GRID)
            chosen = student.call("survivors", costs, float(_KEPT), shape=(_KEPT,))
            numbered = _numbers(chosen, _SAMPLES)
            if numbered is None:
                return _Found(targets, parents, costs, "no such samples")
            kept = numbered
    return _Found(targets, parents, costs, "")


def _replay(
    sheet: Sheet, character: Character, reference: FloatArray, targets: FloatArray
) -> Measured:
    """Follow targets (w, 3) from the reference's first state; the states are in the hash."""
    model, velocity = DynamicsModel(character), _velocity(reference)
    farthest, highest = 0.0, 0.0
    with worlds(character, 1, hash_states=True) as batch:
        batch.reset(position=reference[:1], velocity=np.zeros((1, FOOT + JOINTS)))
        for target, desired, speed in zip(targets, reference[1:], velocity, strict=True):
            advance(batch, np.zeros(1, dtype=np.intp), target[np.newaxis])
            off = errors(model, batch.position, batch.velocity, desired, speed)
            farthest = max(farthest, float(off.distances()[0]))
            highest = max(highest, float(batch.position[0, 1]))
        sheet.hashes.append(batch.state_hashes[0])
    return Measured(farthest <= _NEAR, f"± {farthest:.3f} m; foot {highest:.3f} m high")


def _velocity(reference: FloatArray) -> FloatArray:
    """The mean velocities (w, 6) around the end of each window."""
    after = np.vstack((reference[2:], reference[-1:]))
    return (after - reference[:-1]) * (RATE / (2.0 * WINDOW))
