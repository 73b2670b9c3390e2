"""What a planned walk bears that nobody told it of: `python -m benchmarks.planned_pushes`.

A row a kind of push at the root, at random moments and from random sides. A walk ends by falling:
the centre of mass lower than 0.65 of the clip's, or the root turned by more than 1.5 rad from the
clip's, where that has given way to. Kind `fall` is a push that throws the character down, which is
to get up and to walk on. All of them take two hours on two cores.
"""

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

from msgs_config.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
from rich.console import Console  # noqa: E402
from rich.progress import track  # noqa: E402
from rich.table import Table  # noqa: E402

from controller_node.behaviours.base import Mode  # noqa: E402
from controller_node.parameters import make_controller  # noqa: E402
from controller_node.planner.anchor import Anchor  # noqa: E402
from experiment.commands.settings import node_settings  # noqa: E402
from experiment.plan import Plan, make_plan  # noqa: E402
from msgs_config import rotations  # noqa: E402
from msgs_config.arrays import FloatArray  # noqa: E402
from msgs_config.dynamics import DynamicsModel  # noqa: E402
from msgs_config.errors import ActuatedCharactersError, SimulationError  # noqa: E402
from msgs_config.stamped import StampedReference, StampedState  # noqa: E402
from sim_node.parameters import make_role, make_settings  # noqa: E402
from sim_node.pushes import PushSchedule  # noqa: E402
from sim_node.simulation import Simulation  # noqa: E402

LOWEST, FARTHEST_TURN = 0.65, 1.5  # of the clip's height; rad
CYCLE = 1.27  # s, of the walk
LINK = "root"
EVERY = 0.1  # s, from one look to the next
NODES = ("sim_node", "controller_node")


@dataclass(frozen=True)
class Push:
    """A push at the root's centre of mass."""

    time: float  # s
    impulse: tuple[float, float]  # N s, forwards and to the left
    lasts: float  # s


@dataclass(frozen=True)
class Walk:
    """A walk, and what comes to it."""

    kind: str
    seed: int
    duration: float  # s
    pushes: tuple[Push, ...]
    behaviour: str
    settings: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What has become of a walk."""

    walk: Walk
    fell_at: float | None  # s
    upright: bool  # at the end, and tracking its own clip
    errors: tuple[float, ...]  # m, of the centre of mass, from where the clip has given way to
    away: float  # m, of the clip's centre of mass from its own place, at the end


# What is tried


def _again_and_again(impulse: float) -> Callable[[np.random.Generator, int], list[Push]]:
    def pushes(draws: np.random.Generator, number: int) -> list[Push]:
        del number
        sides, moments = draws.uniform(-math.pi, math.pi, 9), draws.uniform(0.0, 1.0, 9)
        return [
            Push(2.0 * k + 1.0 + float(moments[k]), _turned(impulse, float(sides[k])), 0.1)
            for k in range(9)
        ]

    return pushes


def _once(forwards: float, sideways: float) -> Callable[[np.random.Generator, int], list[Push]]:
    def pushes(draws: np.random.Generator, number: int) -> list[Push]:
        side = (0.0, sideways) if number % 4 == 0 else (0.0, -sideways)
        impulse = (forwards, 0.0) if number % 2 else side
        return [Push(1.0 + float(draws.uniform(0.0, CYCLE)), impulse, 0.2)]

    return pushes


def _anywhere(impulse: float) -> Callable[[np.random.Generator, int], list[Push]]:
    def pushes(draws: np.random.Generator, number: int) -> list[Push]:
        del number
        time, side = 1.0 + float(draws.uniform(0.0, CYCLE)), float(draws.uniform(-math.pi, math.pi))
        return [Push(time, _turned(impulse, side), 0.2)]

    return pushes


def _turned(length: float, angle: float) -> tuple[float, float]:
    return length * math.cos(angle), length * math.sin(angle)


@dataclass(frozen=True)
class Kind:
    """How a walk is pushed."""

    pushes: Callable[[np.random.Generator, int], list[Push]]
    duration: float  # s
    behaviour: str = "tracking"


KINDS = {
    "none": Kind(lambda draws, number: [], 20.0),
    "10 N s every 2 s": Kind(_again_and_again(10.0), 20.0),
    "20 N s every 2 s": Kind(_again_and_again(20.0), 20.0),
    "48 or 60 N s": Kind(_once(48.0, 60.0), 8.5),
    "77 or 96 N s": Kind(_once(77.0, 96.0), 8.5),
    "fall": Kind(_anywhere(200.0), 16.0, "active_ragdoll"),
}


def walks(name: str, count: int, settings: tuple[str, ...]) -> list[Walk]:
    """The walks of a kind, each with other pushes and another seed."""
    kind = KINDS[name]
    return [
        Walk(
            name,
            1 + number,
            kind.duration,
            tuple(kind.pushes(np.random.default_rng((number, len(name))), number)),
            kind.behaviour,
            settings,
        )
        for number in range(count)
    ]


# A walk


class _Watch:
    """What is seen of a walk."""

    def __init__(self, plan: Plan) -> None:
        self._centre_at = DynamicsModel(plan.character).centre_of_mass_at
        self._rate = plan.simulator.integer("rate")
        self.errors: list[float] = []
        self.fell_at: float | None = None  # s
        self.lies = False
        self.away = 0.0  # m

    def look(
        self, tick: int, state: StampedState, wanted: StampedReference, anchor: Anchor
    ) -> None:
        """Look now and then."""
        if tick % round(EVERY * self._rate):
            return
        here, there = self._centre_at(state.position), self._centre_at(wanted.position)
        placed = anchor.out_of(there[np.newaxis])[0]
        self.errors.append(float(np.linalg.norm(here - placed)))
        self.away = float(np.linalg.norm(placed - there))
        root, clip = rotations.exp(state.position[3:6]), rotations.exp(wanted.position[3:6])
        turn = rotations.angle_between(
            root, rotations.multiply(rotations.about_z(anchor.yaw), clip)
        )
        self.lies = bool(here[2] < LOWEST * there[2] or turn > FARTHEST_TURN)
        if self.lies:
            self.fall(tick)

    def fall(self, tick: int) -> None:
        """Remember the first time."""
        self.lies = True
        if self.fell_at is None:
            self.fell_at = tick / self._rate


def attempt(walk: Walk) -> Outcome:
    """Walk to the end, or to where it falls and nothing is to get it up."""
    plan = _plan(walk)
    controller = make_controller(plan.character, plan.reference, plan.controller)
    watch, pushes = _Watch(plan), _schedule(walk, plan)
    role, world = make_role(plan.character, plan.simulator), make_settings(plan.simulator)
    with Simulation([role], world) as simulation:
        simulation.watches_contacts = controller.needs_contacts
        (actor,) = simulation.actors
        first_ns = actor.state.stamp_ns
        for tick in range(plan.ticks):
            contacts = None if actor.contacts is None else actor.contacts.wrenches
            effort, wanted = controller.answer(actor.state, first_ns, contacts)
            outlook = controller.outlook
            watch.look(tick, actor.state, wanted, outlook.anchor if outlook else Anchor())
            if watch.lies and walk.behaviour == "tracking":
                break
            efforts = [np.where(actor.commanded, effort, 0.0)]
            try:
                simulation.step(efforts, [pushes.take(simulation.tick)])
            except SimulationError:
                watch.fall(tick)
                break
    tracks = controller.mode is not None and controller.mode.phase.mode is Mode.TRACK
    upright = tracks and not watch.lies
    return Outcome(walk, watch.fell_at, upright, tuple(watch.errors), watch.away)


def _schedule(walk: Walk, plan: Plan) -> PushSchedule:
    schedule, rate = PushSchedule(plan.character), plan.simulator.integer("rate")
    nowhere: FloatArray = np.zeros((0, 3))  # the centre of mass
    for push in walk.pushes:
        force = np.array((*push.impulse, 0.0, 0.0, 0.0, 0.0)) / push.lasts
        schedule.add(
            [LINK],
            force[np.newaxis],
            nowhere,
            first_tick=1 + round(push.time * rate),
            ticks=round(push.lasts * rate),
        )
    return schedule


def _plan(walk: Walk) -> Plan:
    given = node_settings(list(walk.settings), NODES)
    own = {"plan.seed": walk.seed, "plan.workers": 1, "behaviour": walk.behaviour}
    controller = {"planner": "predictive", **own, **given["controller_node"]}
    clip = {"reference": "clip", "clip": "walk"}
    return make_plan("humanoid", walk.duration, clip, given["sim_node"], controller)


# What is said of them


def main() -> int:
    """Push walks, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    kinds = list(KINDS)
    parser.add_argument("kinds", nargs="*", default=kinds, help=", ".join(f"'{k}'" for k in kinds))
    parser.add_argument("--runs", type=int, default=24, help="of each kind (%(default)s)")
    parser.add_argument("--set", action="append", default=[], help="NODE.NAME:=VALUE, as of run")
    parser.add_argument("--processes", type=int, default=2, help="(%(default)s)")
    parser.add_argument("--out", type=Path, help="file for what has become of each, JSON")
    options = parser.parse_args()
    if min(options.runs, options.processes) < 1:
        parser.error("--runs and --processes must be 1 or more")
    if unknown := set(options.kinds) - set(KINDS):
        parser.error(f"there is no kind {unknown.pop()!r}; there are {', '.join(KINDS)}")
    tasks = [
        walk for kind in options.kinds for walk in walks(kind, options.runs, tuple(options.set))
    ]
    console = Console(width=100)
    try:
        _plan(tasks[0])  # what is wrong is said at once
        with ProcessPoolExecutor(options.processes, get_context("spawn")) as pool:
            done = list(track(pool.map(attempt, tasks), total=len(tasks), console=console))
    except ActuatedCharactersError as error:
        raise SystemExit(f"error: {error}") from error
    table = Table(title="pushes that the planner does not know of", title_justify="left")
    for column in ("kind", "upright", "fell at, s", "error 0, 1, 2, 3 s after, m", "away, m"):
        table.add_column(column)
    for kind in options.kinds:
        table.add_row(kind, *_row([each for each in done if each.walk.kind == kind]))
    console.print(table)
    if options.out is not None:
        options.out.write_text(json.dumps([asdict(each) for each in done]))
    return 0


def _row(outcomes: Sequence[Outcome]) -> list[str]:
    fell = [f"{each.fell_at:.1f}" for each in outcomes if each.fell_at is not None]
    upright = [each for each in outcomes if each.upright]
    return [
        f"{len(upright)} of {len(outcomes)}",
        " ".join(fell),
        " ".join(f"{np.median(errors):.3f}" for errors in _errors_after(outcomes) if errors),
        f"{np.median([each.away for each in upright]):.2f}" if upright else "",
    ]


def _errors_after(outcomes: Sequence[Outcome]) -> list[list[float]]:
    """The errors in the first, second, third and fourth second after all pushes."""
    found: list[list[float]] = [[], [], [], []]
    second = round(1.0 / EVERY)
    for each in outcomes:
        for push in each.walk.pushes or (Push(1.0, (0.0, 0.0), 0.0),):
            first = math.ceil((push.time + push.lasts) / EVERY)
            for number, errors in enumerate(found):
                errors += each.errors[first + number * second :][:second]
    return found


if __name__ == "__main__":
    sys.exit(main())
