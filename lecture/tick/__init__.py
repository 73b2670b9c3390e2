"""One tick of a walk taken apart: what touches, which equations there are, and where time goes."""

import time
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from actuated_characters.bags.recording import Recording
from actuated_characters.render.plots import label
from actuated_characters.runs.plan import make_plan
from controller_node.parameters import make_controller
from lecture.framework.result import StudyResult
from lecture.framework.study import WALK, RunResult, RunSpec, StudyRunner
from lecture.tick.stages import STAGES, StagedTick, TickStages, pairs_that_may_touch
from msgs_config.arrays import FloatArray
from sim_node.physics.engine import INSTALLED_ENGINES
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

TITLE = "a tick of a walk: what touches, which equations there are, and where its time goes"
RUNS = len(INSTALLED_ENGINES)

_DURATION = 3.0  # s
_TAKEN_APART = "mujoco"  # the engine whose stages can be called one by one
_PHYSICS, _LAW, _REST = "physics", "control law", "messages, recorder"


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Walk with each engine; make the ticks of one again, stage by stage; time the whole."""
    outcomes = {engine: runner.run(_case(engine)) for engine in INSTALLED_ENGINES}
    walk = outcomes[_TAKEN_APART].recording
    world = StagedTick(walk)
    states = zip(walk.position[:-1], walk.velocity[:-1], walk.effort, strict=True)
    ticks = [world.run(*state) for state in states]
    off = np.abs(np.array([tick.velocity for tick in ticks]) - walk.velocity[1:]).max(axis=1)
    stages = {
        stage: 1e6 * float(np.median([tick.seconds[stage] for tick in ticks])) for stage in STAGES
    }
    times = {engine: _time_parts(engine, outcome) for engine, outcome in outcomes.items()}
    touching = {engine: touching_links(each.recording) for engine, each in outcomes.items()}
    _add_rows(result, world, ticks, stages, times, touching)
    _draw(result, walk.times[: len(ticks)], ticks, stages, times)
    columns = {"time_s": walk.times[: len(ticks)]} | {
        "contacts": np.array([float(tick.contacts) for tick in ticks]),
        "rows_of_J": np.array([float(tick.rows) for tick in ticks]),
        "normal_force_N": np.array([tick.force for tick in ticks]),
    }
    result.add_curves("tick_contacts", columns)
    result.remarks += [
        f"{_TAKEN_APART}'s ticks, made again from the messages stage by stage, lead to the "
        f"velocities of the next messages but for {np.median(off):.0e} (median), {off.max():.0e} "
        "(largest)",
        f"the stages take {sum(stages.values()):.0f} us of the "
        f"{times[_TAKEN_APART][_PHYSICS]:.0f} us of a step of the simulator",
    ]
    if "bullet" in times:
        result.remarks.append("PyBullet has one call for all stages, and tells none apart")


def _case(engine: str) -> RunSpec:
    return RunSpec(engine, "humanoid", _DURATION, WALK, {"engine": engine}, contacts=True)


def _time_parts(engine: str, walk: RunResult) -> dict[str, float]:
    """The parts of a tick's time, µs: two by themselves, and the rest of the run."""
    plan = make_plan("humanoid", 1.0, WALK, {"engine": engine}, {})
    controller = make_controller(plan.character, plan.reference, plan.controller)
    setup = make_character_setup(plan.character, plan.simulator)
    physics, control = [], []
    with Simulation([setup], make_simulation_settings(plan.simulator)) as simulation:
        (character,) = simulation.characters
        episode_ns = character.state.stamp_ns
        for _ in range(plan.ticks):
            began = time.perf_counter()
            effort, _ = controller.compute_effort(character.state, episode_ns)
            answered = time.perf_counter()
            simulation.step([np.where(character.commanded, effort, 0.0)])
            control.append(answered - began)
            physics.append(time.perf_counter() - answered)
    seconds, ticks = walk.summary["wall_time_s"], walk.summary["ticks"]
    assert isinstance(seconds, float) and isinstance(ticks, int)
    parts = [1e6 * float(np.median(each)) for each in (physics, control)]
    rest = 1e6 * seconds / ticks - sum(parts)
    return {_PHYSICS: parts[0], _LAW: parts[1], _REST: rest}


def _add_rows(
    result: StudyResult,
    world: StagedTick,
    ticks: Sequence[TickStages],
    stages: Mapping[str, float],
    times: Mapping[str, Mapping[str, float]],
    touching: Mapping[str, Sequence[float]],
) -> None:
    """What each stage finds, and how long it and all else of a tick take."""
    size = int(world.model.nv)
    found: dict[str, tuple[str, list[float]]] = {
        "collision detection": (
            f"contacts, of {pairs_that_may_touch(world.model)} pairs that may touch",
            [tick.contacts for tick in ticks],
        ),
        "contact handling": ("rows of J", [tick.rows for tick in ticks]),
        "construct equations": (f"entries of M, {size} x {size}, of one branch", [_entries(world)]),
        "solve": ("sweeps of the solver", [tick.iterations for tick in ticks]),
        "update velocity": ("normal impulse (N s)", [tick.impulse for tick in ticks]),
        "update position": ("numbers of q", [int(world.model.nq)]),
    }
    for stage, (what, numbers) in found.items():
        row = {"engine": _TAKEN_APART, "part": stage, "time (us)": stages[stage]}
        result.rows.append(row | _counted(what, numbers))
    for engine, parts in times.items():
        for part, microseconds in parts.items():
            row = {"engine": engine, "part": part, "time (us)": microseconds}
            counts = touching[engine] if part == _PHYSICS else []
            result.rows.append(row | _counted("links that touch" if counts else "", counts))


def _counted(what: str, counts: Sequence[float]) -> dict[str, object]:
    middle, most = (float(np.median(counts)), float(max(counts))) if counts else (None, None)
    return {"finds": what, "median": middle, "most": most}


def touching_links(run: Recording) -> list[float]:
    """How many links of a walk touch something, by tick."""
    return [0.0 if touch is None else float(len(touch.links)) for touch in run.contacts]


def _entries(world: StagedTick) -> int:
    """How many entries of M are of two joints one of which carries the other."""
    model = world.model
    return 2 * int(model.M_rownnz.sum()) - int(model.nv)


def _draw(
    result: StudyResult,
    times: FloatArray,
    ticks: Sequence[TickStages],
    stages: Mapping[str, float],
    parts: Mapping[str, Mapping[str, float]],
) -> None:
    flow, touching, whole = result.add_panels(result.name, 3, 1, (10.0, 9.5))
    rows = [row for row in result.rows if row["part"] in STAGES]
    for place, row in enumerate(rows):
        flow.barh(-place, row["time (us)"], color="tab:blue")
        text = f" {row['time (us)']:.1f} µs   {row['finds']}: {row['median']:.3g}"
        flow.text(row["time (us)"], -place, text, va="center", fontsize="small")
    flow.set_yticks([-place for place in range(len(rows))], [row["part"] for row in rows])
    flow.set_xlim(0.0, 1.6 * max(stages.values()))
    label(flow, "time (µs)", "", f"the stages of a tick, {_TAKEN_APART}: medians", legend=None)
    touching.step(times, [tick.rows for tick in ticks], label="rows of J", linewidth=1.0)
    touching.step(times, [tick.contacts for tick in ticks], label="contacts", linewidth=1.0)
    force = touching.twinx()
    forces = [tick.force for tick in ticks]
    force.plot(times, forces, color="tab:green", linewidth=0.8, alpha=0.7, label="normal force")
    force.set_ylabel("normal force (N)")
    force.legend(loc="upper right", fontsize="small")
    label(touching, "time (s)", "count", "a walk: what touches", legend="upper left")
    _draw_whole(whole, parts)


def _draw_whole(axes: Axes, parts: Mapping[str, Mapping[str, float]]) -> None:
    """A tick's time, an engine a line."""
    for place, each in enumerate(parts.values()):
        start = 0.0
        for number, (name, width) in enumerate(each.items()):
            color = f"C{number}"
            named = name if place == 0 else None
            axes.barh(-place, width, left=start, color=color, label=named)
            middle = start + 0.5 * width
            axes.text(middle, -place, f"{width:.0f}", ha="center", va="center", color="white")
            start += width
    axes.set_yticks([-place for place in range(len(parts))], list(parts))
    label(axes, "time (µs)", "", "where a tick's time goes, walk", legend="lower right")
