"""What a control law itself takes for the humanoid, beside PyBullet's own stable PD in Python."""

import time
from collections.abc import Callable, Sequence
from functools import lru_cache

from rich.console import Console

from actuated_characters.metrics.run_metrics import Tick
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from benchmarks.closed_loop import WALK
from benchmarks.support.printed import make_table
from benchmarks.support.ratios import Ratio
from controller_node.control_laws import LAWS
from controller_node.parameters import make_controller
from controller_node.references.base import Reference, ReferenceState
from sim_node.physics.engine import INSTALLED_ENGINES

_DURATION = 5.0  # s of simulated time
_ROUNDS = 7  # over all states; the best round counts, in which others disturbed the least
_NEEDS_A_FILE = "feedforward"


def measure_control_laws(console: Console) -> list[Ratio]:
    """Measure and print the table; the ratio of each law to PyBullet's, where that is installed."""
    if "bullet" not in INSTALLED_ENGINES:
        console.print("control laws: there is no PyBullet, whose own law they are measured by")
        return []
    from benchmarks.support.deep_mimic import DeepMimicStablePd

    console.print("control laws: humanoid ...")
    ticks = list(ticks_in_process(make_plan("humanoid", _DURATION, WALK, {}, {})))
    with DeepMimicStablePd() as theirs:
        theirs_us = min(theirs.duration_us(ticks) for _ in range(_ROUNDS))
    heading = ("", "law", "with reference", "law / PyBullet's")
    table = make_table("one control law (µs a tick)", heading)
    ratios = []
    for name in LAWS.names:
        if name == _NEEDS_A_FILE:
            continue
        law_us, whole_us = _ours(name, ticks)
        table.add_row(name, f"{law_us:.0f}", f"{whole_us:.0f}", f"{law_us / theirs_us:.3f}")
        ratios.append(Ratio(f"law {name}", law_us / theirs_us, "law / PyBullet's stable PD"))
    table.add_row("PyBullet's stable PD (deep_mimic)", f"{theirs_us:.0f}", "", "")
    console.print(table)
    return ratios


class _CachedReference:
    """A reference that has been worked out before, so that it takes no time."""

    def __init__(self, reference: Reference) -> None:
        self._sample = lru_cache(maxsize=None)(reference.sample)

    def sample(self, time: float) -> ReferenceState:
        """The desired state."""
        return self._sample(time)


def _ours(law: str, ticks: Sequence[Tick]) -> tuple[float, float]:
    """Durations in µs of an answer: with the desired states known before, and with all of it."""
    plan = make_plan("humanoid", _DURATION, WALK, {}, {"law": law})
    first = ticks[0].state.stamp_ns

    def answers_us(reference: Reference) -> float:
        controller = make_controller(plan.character, reference, plan.controller)
        return _duration_us(
            lambda: [controller.compute_effort(t.state, first) for t in ticks], ticks
        )

    return answers_us(_CachedReference(plan.reference)), answers_us(plan.reference)


def _duration_us(work: Callable[[], object], ticks: Sequence[Tick]) -> float:
    """Processor time a tick, which others on the machine disturb less than the clock's."""
    durations = []
    for _ in range(_ROUNDS):
        started = time.process_time()
        work()
        durations.append(time.process_time() - started)
    return 1e6 * min(durations) / len(ticks)
