"""Push maps: the impulse by direction that a character survives."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.bags.recording import Recording
from lecture.framework.study import RunSpec, StudyRunner, plan_push
from msgs_config.arrays import FloatArray

LARGEST = 64.0  # N s
_DURATION = 0.2  # s
_RATE = 240  # Hz
_LINK = "root"


@dataclass(frozen=True)
class PushMap:
    """By direction, rad to the left of ahead: impulses in N s, between which the limit is."""

    directions: tuple[float, ...]
    survived: tuple[float, ...]
    fell: tuple[float, ...]  # `LARGEST` where none threw it down

    def along(self, impulses: Sequence[float], axis: int) -> FloatArray:
        """A closed curve of impulses: to the right (axis 0), or ahead (axis 1)."""
        closed = [*range(len(self.directions)), 0]
        turn = (lambda angle: -math.sin(angle)) if axis == 0 else math.cos
        return np.array([impulses[row] * turn(self.directions[row]) for row in closed])


def push_map(
    runner: StudyRunner,
    case: RunSpec,
    time: float,
    directions: int,
    halvings: int,
    has_fallen: Callable[[Recording], bool],
) -> PushMap:
    """Bisect between no push and `LARGEST`, in each of some directions, so many times.

    Args:
        runner: Makes the runs.
        case: What is pushed; it heads along x at the push, and goes on for some seconds.
        time: Of the push, s.
        directions: How many, all around.
        halvings: Runs for each.
        has_fallen: Whether a run's character fell.
    """
    angles = tuple(math.tau * number / directions for number in range(directions))
    limits = [_limit(runner, case, time, angle, halvings, has_fallen) for angle in angles]
    return PushMap(angles, tuple(low for low, _ in limits), tuple(high for _, high in limits))


def _limit(
    runner: StudyRunner,
    case: RunSpec,
    time: float,
    angle: float,
    halvings: int,
    has_fallen: Callable[[Recording], bool],
) -> tuple[float, float]:
    low, high = 0.0, LARGEST
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        force = middle / _DURATION
        push = plan_push(
            time, _RATE, _LINK, (force * math.cos(angle), force * math.sin(angle), 0.0)
        )
        pushed = replace(
            case,
            label=f"{case.label}_{math.degrees(angle):.0f}_{middle:g}Ns",
            simulator={**case.simulator, "rate": _RATE, "wrench_duration": _DURATION},
            pushes=[push],
        )
        outcome = runner.run(pushed)
        if outcome.diverged or has_fallen(outcome.recording):
            high = middle
        else:
            low = middle
    return low, high
