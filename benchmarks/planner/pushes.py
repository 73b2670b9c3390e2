"""Disturbances that a planned walk survives untold: `python -m benchmarks.planner.pushes`.

A row a kind of push at the root, at random moments and from random sides. A walk ends by falling,
as `actuated_characters.metrics.falls` has it, against an upright posture. Kind `balls` throws them
at the chest, kind `standing` holds a pose for a minute. Kind `fall` is a push that throws the
character down, which is to get up and to walk on. Kind `any` is for `--picture`: the impulse that
half of the walks bear, by direction. All of them take two hours on two cores.
"""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
from rich.console import Console  # noqa: E402
from rich.progress import track  # noqa: E402
from rich.table import Table  # noqa: E402

from actuated_characters.commands.common.settings import node_settings  # noqa: E402
from actuated_characters.metrics.falls import FallWatch, PostureReader  # noqa: E402
from actuated_characters.runs.bare_loop import ticks_in_process  # noqa: E402
from actuated_characters.runs.plan import RunPlan, make_plan  # noqa: E402
from actuated_characters.runs.planned.throws import PlannedThrow, plan_throws  # noqa: E402
from actuated_characters.runs.planned.wrenches import PlannedPush, plan_push  # noqa: E402
from benchmarks.planner.push_picture import draw  # noqa: E402
from benchmarks.planner.walks import KINDS, Impulse, Walk, walks  # noqa: E402
from controller_node.behaviours.base import Mode  # noqa: E402
from controller_node.parameters import make_controller  # noqa: E402
from controller_node.planner.anchor import Anchor  # noqa: E402
from msgs_config.character.dynamics import DynamicsModel  # noqa: E402
from msgs_config.errors import ActuatedCharactersError, SimulationError  # noqa: E402
from msgs_config.messages.state import StampedReference, StampedState  # noqa: E402

LINK = "root"
BALL = "mass=2.5 speed=8 target=chest at={:.4f} from={:.4f}"
BALL_LIFETIME = 0.6  # s, of which it flies 0.2
MISSED = 0.2  # m that a walk is beside its clip where a ball misses it
EVERY = 0.1  # s, from one look to the next
COLUMNS = ("kind", "upright", "fell at, s", "error 0, 1, 2, 3 s after, m", "away, m", "missed")
NODES = ("sim_node", "controller_node")


@dataclass(frozen=True)
class WalkResult:
    """What has become of a walk."""

    walk: Walk
    fell_at: float | None  # s
    upright: bool  # at the end, and tracking its own clip
    errors: tuple[float, ...]  # m, of the centre of mass, from where the clip has given way to
    away: float  # m, of the clip's centre of mass from its own place, at the end
    missed: int  # balls that missed


# A walk


class _Watch:
    """What is seen of a walk."""

    def __init__(self, plan: RunPlan) -> None:
        self._centre_at = DynamicsModel(plan.character).centre_of_mass_at
        self.rate = plan.simulation.rate_hz
        self._fall = FallWatch(PostureReader(plan.character), 1.0 / EVERY)
        self._time = 0.0  # s
        self.errors: list[float] = []
        self.fell_at: float | None = None  # s
        self.lies = False
        self.away = 0.0  # m
        self.missed = 0

    def check_hit(
        self, state: StampedState, wanted: StampedReference, ball: Sequence[float]
    ) -> None:
        """Look at whether a ball of this velocity hits, which arrives now where the clip is."""
        beside = self._centre_at(state.position) - self._centre_at(wanted.position)
        distance = abs(beside[0] * ball[1] - beside[1] * ball[0]) / math.hypot(*ball[:2])
        self.missed += bool(distance > MISSED)

    def look(
        self, tick: int, state: StampedState, wanted: StampedReference, anchor: Anchor
    ) -> None:
        """Look now and then."""
        self._time = tick / self.rate
        if tick % round(EVERY * self.rate):
            return
        here, there = self._centre_at(state.position), self._centre_at(wanted.position)
        placed = anchor.to_world(there[np.newaxis])[0]
        self.errors.append(float(np.linalg.norm(here - placed)))
        self.away = float(np.linalg.norm(placed - there))
        self.lies = self._fall.has_fallen(state.position)
        if self.lies:
            self.fall()

    def fall(self) -> None:
        """Remember the first time."""
        self.lies = True
        if self.fell_at is None:
            self.fell_at = self._time


def attempt(walk: Walk) -> WalkResult:
    """Walk to the end, or to where it falls and nothing is to get it up."""
    plan, kind = _plan(walk), KINDS[walk.kind]
    controller = make_controller(plan.character, plan.reference, plan.controller)
    watch = _Watch(plan)
    pushes, throws = ([], _throws(plan, walk)) if kind.balls else (_planned(plan, walk), [])
    arrivals = {
        round(push.time * watch.rate): each.throw.velocity
        for push, each in zip(walk.pushes, throws, strict=False)
    }
    try:
        ticks = ticks_in_process(plan, pushes, throws, controller)
        for number, tick in enumerate(ticks):
            outlook = controller.outlook
            assert tick.reference is not None
            watch.look(number, tick.state, tick.reference, outlook.anchor if outlook else Anchor())
            if number in arrivals:
                watch.check_hit(tick.state, tick.reference, arrivals[number])
            if watch.lies and kind.behaviour == "tracking":
                break
    except SimulationError:
        watch.fall()
    tracks = controller.mode is not None and controller.mode.phase.mode is Mode.TRACK
    upright = tracks and not watch.lies
    return WalkResult(walk, watch.fell_at, upright, tuple(watch.errors), watch.away, watch.missed)


def _planned(plan: RunPlan, walk: Walk) -> list[PlannedPush]:
    lasts = KINDS[walk.kind].lasts
    return [
        plan_push(plan, LINK, (x / lasts, y / lasts, 0.0), push.time)
        for push in walk.pushes
        for x, y in [push.impulse]
    ]


def _throws(plan: RunPlan, walk: Walk) -> list[PlannedThrow]:
    """A ball for each push, from where it comes."""
    texts = [
        BALL.format(push.time, math.degrees(math.atan2(-push.impulse[1], -push.impulse[0])))
        for push in walk.pushes
    ]
    return plan_throws(plan, texts)[0]


def _plan(walk: Walk) -> RunPlan:
    given, kind = node_settings(list(walk.settings), NODES), KINDS[walk.kind]
    simulator = {"wrench_duration": kind.lasts, "ball_lifetime": BALL_LIFETIME}
    own = {"plan.seed": walk.seed, "plan.workers": 1, "behaviour": kind.behaviour}
    controller = {"planner": "predictive", **own, **given["controller_node"]}
    motion = {"reference": "hold"} if kind.stands else {"reference": "clip", "clip": "walk"}
    return make_plan("humanoid", kind.duration, motion, simulator | given["sim_node"], controller)


# Tables


def main() -> int:
    """Push walks, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    kinds = list(KINDS)
    usual = [kind for kind in kinds if kind != "any"]
    parser.add_argument("kinds", nargs="*", default=usual, help=", ".join(f"'{k}'" for k in kinds))
    parser.add_argument("--runs", type=int, default=24, help="of each kind (%(default)s)")
    parser.add_argument("--set", action="append", default=[], help="NODE.NAME:=VALUE, as of run")
    parser.add_argument("--processes", type=int, default=2, help="(%(default)s)")
    parser.add_argument("--out", type=Path, help="file for what has become of each, JSON")
    parser.add_argument("--picture", type=Path, help="file for the picture of the kind `any`, PNG")
    options = parser.parse_args()
    if options.picture is not None and "any" not in options.kinds:
        parser.error("--picture is of the kind 'any'")
    if min(options.runs, options.processes) < 1:
        parser.error("--runs and --processes must be 1 or more")
    if unknown := set(options.kinds) - set(KINDS):
        parser.error(f"there is no kind {unknown.pop()!r}; there are {', '.join(KINDS)}")
    tasks = [
        walk for kind in options.kinds for walk in walks(kind, options.runs, tuple(options.set))
    ]
    console = Console(width=100)
    try:
        _plan(tasks[0])  # a mistake shows at once
        with ProcessPoolExecutor(options.processes, get_context("spawn")) as pool:
            done = list(track(pool.map(attempt, tasks), total=len(tasks), console=console))
    except ActuatedCharactersError as error:
        raise SystemExit(f"error: {error}") from error
    table = Table(*COLUMNS, title="what the planner does not know of", title_justify="left")
    for kind in options.kinds:
        table.add_row(kind, *_row([each for each in done if each.walk.kind == kind]))
    console.print(table)
    if options.out is not None:
        options.out.write_text(json.dumps([asdict(each) for each in done]))
    if options.picture is not None:
        impulses = [each.walk.pushes[0].impulse for each in done if each.walk.kind == "any"]
        draw(impulses, [each.upright for each in done if each.walk.kind == "any"], options.picture)
    return 0


def _row(outcomes: Sequence[WalkResult]) -> list[str]:
    fell = [f"{each.fell_at:.1f}" for each in outcomes if each.fell_at is not None]
    upright = [each for each in outcomes if each.upright]
    return [
        f"{len(upright)} of {len(outcomes)}",
        " ".join(fell),
        " ".join(f"{np.median(errors):.3f}" for errors in _errors_after(outcomes) if errors),
        f"{np.median([each.away for each in upright]):.2f}" if upright else "",
        str(sum(each.missed for each in outcomes)) if KINDS[outcomes[0].walk.kind].balls else "",
    ]


def _errors_after(outcomes: Sequence[WalkResult]) -> list[list[float]]:
    """The errors in the first, second, third and fourth second after all pushes."""
    found: list[list[float]] = [[], [], [], []]
    second = round(1.0 / EVERY)
    for each in outcomes:
        lasts = KINDS[each.walk.kind].lasts
        for push in each.walk.pushes or (Impulse(1.0, (0.0, 0.0)),):
            first = math.ceil((push.time + lasts) / EVERY)
            for number, errors in enumerate(found):
                errors += each.errors[first + number * second :][:second]
    return found


if __name__ == "__main__":
    sys.exit(main())
