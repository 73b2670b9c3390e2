"""Random runs that fall, each with ten inputs, and what `shrink` leaves of them.

A humanoid walks by the machine `walk`, and is sent three pushes, three balls, two velocities and
two changes of parameters, drawn until it falls. Of what is left each input is left out once more,
and made 5 % smaller, in a whole run: it must not fall.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console

from actuated_characters.fork.execution import run_fork
from actuated_characters.fork.plan import ForkInputs, plan_fork
from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.throws import plan_throws
from actuated_characters.runs.planned.velocities import plan_velocities
from actuated_characters.runs.planned.wrenches import parse_push
from actuated_characters.shrink.inputs import Event, Setting
from actuated_characters.shrink.minimal import SHARE, Sizes
from actuated_characters.shrink.shrinking import Shrinking, plan_shrinking, run_shrunk
from actuated_characters.shrink.trial import script_of
from actuated_characters.shrink.trials import Trials, shrink
from benchmarks.support.machine import describe_machine
from benchmarks.support.printed import make_table
from msgs_config.errors import ActuatedCharactersError, SimulationError
from msgs_config.messages.clock import FIRST_TICK, TickClock

_DURATION = 4.0  # s
_LINKS = ("chest", "root", "neck", "left_hip", "right_knee", "left_wrist")
_JOINTS = ("left_knee", "right_hip", "left_hip", "right_ankle", "chest")
_COLUMNS = ("run", "left", "what is left", "trials", "wall time", "processor time", "minimal")


def main() -> None:
    """Draw runs, shrink them, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="that fall (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of what is drawn (%(default)s)")
    parser.add_argument("--first", type=int, default=1, help="number of the first (%(default)s)")
    options = parser.parse_args()
    table = make_table(describe_machine(), _COLUMNS)
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder) / "base"
        plan = _base(base)
        for number in range(options.first, options.first + options.runs):
            rng = np.random.default_rng((options.seed, number))
            own = Path(folder) / str(number)
            _draw_failure(base, plan, rng, own / "run")
            row = _shrink(own / "run", own)
            print(number, *row, sep=" | ", flush=True)
            table.add_row(str(number), *row)
    Console(width=180).print(table)


def _base(directory: Path) -> RunPlan:
    """Record a run without inputs, from which those with inputs begin; its plan."""
    behaviour = {"behaviour": "state_machine", "machine": "walk"}
    plan = make_plan("humanoid", _DURATION, {}, {}, behaviour)
    prepare_directory(directory, overwrite=True)
    run_in_process(plan, directory)
    return plan


def _draw_failure(base: Path, plan: RunPlan, rng: np.random.Generator, directory: Path) -> None:
    """Draw inputs and run them, until it falls."""
    while True:
        try:
            events = _draw(plan, rng)
        except ActuatedCharactersError:  # such as a ball that would come too early
            continue
        fork = plan_fork(base, 0.0, ForkInputs({}, with_later=False))
        prepare_directory(directory, overwrite=True)
        try:
            run_fork(fork, directory, script=script_of(fork.recording, events, compared=0))
        except SimulationError:  # it diverged, which is no fall
            continue
        if read_metrics(directory)[0]["fell"]:
            return


def _draw(plan: RunPlan, rng: np.random.Generator) -> Sequence[Event]:
    """Ten inputs."""
    clock = TickClock(plan.simulation.rate_hz)
    within = partial(rng.uniform, 0.3, 0.7 * _DURATION)
    first, second = np.sort(within(size=2)).tolist()
    text = " ".join(
        f"{rng.uniform(0.2, 0.8):.2f},0,{rng.uniform(-0.4, 0.4):.2f}@{at:.2f}"
        for at in (first, second)
    )
    steered, velocities = plan_velocities(plan, text)
    balls = [
        f"mass={rng.uniform(0.3, 4.0):.2f} speed={rng.uniform(4.0, 9.0):.2f} "
        f"at={rng.uniform(1.0, 0.7 * _DURATION):.2f} from={rng.uniform(0.0, 360.0):.0f} "
        f"target={rng.choice(('chest', 'root', 'left_knee'))}"
        for _ in range(3)
    ]
    throws, _ = plan_throws(steered, balls)
    events = [Event(0, each) for each in velocities]
    for _ in range(3):
        angle, force = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(30.0, 450.0)
        forces = f"{force * np.cos(angle):.1f},{force * np.sin(angle):.1f},0"
        push = parse_push(f"{rng.choice(_LINKS)}:{forces}@{within():.3f}", plan)
        events.append(Event(clock.tick(push.stamp_ns) - FIRST_TICK + 1, push))
    events += [Event(clock.tick(each.stamp_ns) - FIRST_TICK + 1, each) for each in throws]
    joint, scale = rng.choice(_JOINTS), rng.choice(("gain_scale.p", "gain_scale.d"))
    for name, least, most in ((f"strength.{joint}", 0.1, 1.0), (str(scale), 0.5, 1.5)):
        value = round(float(rng.uniform(least, most)), 3)
        events.append(Event(round(within() * clock.rate_hz), Setting(name, value)))
    return events


def _shrink(run: Path, folder: Path) -> list[str]:
    """Shrink a run; what the table says of it."""
    wall, processor = time.monotonic(), sum(os.times()[:4])
    shrinking = plan_shrinking(run)
    trials = Trials(shrinking, folder)
    with trials.at_once(len(os.sched_getaffinity(0))):
        sizes = shrink(trials)
    assert _falls(shrinking, sizes, folder / "shrunk")
    wall, processor = time.monotonic() - wall, sum(os.times()[:4]) - processor
    lines = [
        f"{line} ({100.0 * size:.3g} %)"
        for line, size in zip(shrinking.describe(sizes), _in_time(shrinking, sizes), strict=True)
    ]
    is_minimal = not any(
        _falls(shrinking, less, folder / "less") for less in _less(shrinking, sizes)
    )
    return [
        f"{len(sizes)} of {shrinking.total}",
        "\n".join(lines),
        str(trials.count),
        f"{wall:.0f} s",
        f"{processor:.0f} s",
        "yes" if is_minimal else "no",
    ]


def _in_time(shrinking: Shrinking, sizes: Sizes) -> list[float]:
    """The sizes in the order of their inputs' times."""
    return [sizes[number] for number in sorted(sizes, key=lambda n: shrinking.inputs[n].row)]


def _less(shrinking: Shrinking, sizes: Sizes) -> list[Sizes]:
    """The same without each input, and with `SHARE` less of each."""
    without = [{n: size for n, size in sizes.items() if n != each} for each in sizes]
    smaller = [
        {**sizes, each: (1.0 - SHARE) * sizes[each]} for each in sizes if each in shrinking.scalable
    ]
    return [*without, *smaller]


def _falls(shrinking: Shrinking, sizes: Sizes, directory: Path) -> bool:
    """Whether a whole run of these inputs falls, by its recorder's figures."""
    prepare_directory(directory, overwrite=True)
    run_shrunk(shrinking, sizes, directory)
    return bool(read_metrics(directory)[0]["fell"])


if __name__ == "__main__":
    main()
