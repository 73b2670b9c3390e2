"""Explicit and semi-implicit Euler, the quaternion's step, and which of them the engines do."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from actuated_characters.render.plots import THEORY, label
from lecture.framework.bodies import Box, write_box
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import HOLD, RunSpec, StudyRunner
from lecture.theory.euler import RigidBody, RigidBodyMotion, move
from lecture.theory.integrators import (
    TURN_RULES,
    energy_and_momentum,
    fall_off,
    swing,
    swing_energy,
    ticks_off,
    tumble,
)
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from sim_node.physics.engine import INSTALLED_ENGINES

TITLE = "time steps of a tumbling body: q+ = q + h/2 w q, and others"

_RATES = (60, 120, 240, 480, 960)  # Hz
RUNS = (len(_RATES) + 1) * len(INSTALLED_ENGINES)

_DURATION = 2.0  # s
_COARSE, _SHOWN = 60, 240  # Hz
_FINE = 8 * max(_RATES)  # Hz, of the theory's steps
_GRAVITY = 9.81  # m/s^2
_BRICK = Box("brick", 6.0, (0.6, 0.4, 0.1))
_SPIN = (1.0, 4.0, 2.0)  # rad/s; the brick's axes are the world's at first
_STIFFNESS, _TARGET = 100.0, 1.0  # N/m, m: those of `lift`, of 1 kg
_FREQUENCY = _STIFFNESS**0.5  # rad/s
_OFF = "turn off (rad)"
_SMALLEST_DRAWN = 1e-17  # rad


@dataclass(frozen=True)
class Tumbling:
    """A brick that nothing turns, by one rule or engine."""

    times: FloatArray  # (t,) s
    turn_xyzw: FloatArray  # (t, 4), of length one only where the rule says so
    spin: FloatArray  # (t, 3) rad/s, world axes

    def changes(self) -> tuple[FloatArray, FloatArray]:
        """Changes (t,) of energy and angular momentum from their first values, as shares."""
        energy, momentum = energy_and_momentum(_BRICK.inertia, self.turn_xyzw, self.spin)
        moved = np.linalg.norm(momentum - momentum[0], axis=1)
        return energy / energy[0] - 1.0, moved / float(np.linalg.norm(momentum[0]))


Ways = Mapping[str, Mapping[int, Tumbling]]
"""Motions by the rule or engine, and the rate in Hz."""


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Throw a brick by each rule and engine, and let a mass swing on a spring."""
    path = write_box(runner, _BRICK)
    runs = {
        engine: {rate: _throw(runner, path, engine, rate) for rate in _RATES}
        for engine in INSTALLED_ENGINES
    }
    ways: dict[str, dict[int, Tumbling]] = {}
    for name, rule in TURN_RULES.items():
        ways[name] = {}
        for rate in _RATES:
            times = np.arange(round(_DURATION * rate) + 1) / rate
            moved = tumble(_BRICK.inertia, rotations.exp(np.zeros(3)), np.array(_SPIN), times, rule)
            ways[name][rate] = Tumbling(times, *moved)
    for engine, by_rate in runs.items():
        ways[engine] = {
            rate: Tumbling(
                np.arange(len(each.centre)) / rate,
                each.turn_xyzw,
                rotations.rotate(each.turn_xyzw, each.angular_velocity),
            )
            for rate, each in by_rate.items()
        }
    exact = _exact()
    for name, tumblings in ways.items():
        result.rows += [_row(name, rate, each, exact, runs) for rate, each in tumblings.items()]
    swings = {engine: _swing(runner, engine) for engine in INSTALLED_ENGINES}
    _draw(result, ways, runs, swings)
    curves = {"time_s": ways[INSTALLED_ENGINES[0]][_SHOWN].times}
    for name, tumblings in ways.items():
        key = name.replace(",", "").replace(" ", "_")
        energy, momentum = tumblings[_SHOWN].changes()
        curves |= {f"{key}_energy_change": energy, f"{key}_momentum_change": momentum}
    result.add_curves("integrators_tumbling", curves)
    _add_remarks(result, ways)


def _throw(runner: StudyRunner, path: str, engine: str, rate: int) -> RigidBodyMotion:
    case = RunSpec(
        label=f"{engine}_{rate}",
        character=path,
        duration=_DURATION,
        reference=HOLD,
        simulator={
            "engine": engine,
            "rate": rate,
            "gravity": _GRAVITY,
            "terrain": "none",
            "initial_velocity": [0.0, 0.0, 0.0, *_SPIN],
        },
        # nothing acts: the simulator waits for the root's effort, which is zero
        controller={"law": "zero", "root_assistance": True},
    )
    run = runner.run(case).recording
    turns = rotations.exp(run.position[:, 3:6])
    velocity = run.velocity
    return RigidBodyMotion(run.position[:, :3], turns, velocity[:, :3], velocity[:, 3:6])


def _swing(runner: StudyRunner, engine: str) -> FloatArray:
    """Place and speed (t, 2) of the mass of `lift` on a spring, from where it would rest."""
    case = RunSpec(
        label=f"{engine}_spring",
        character="lift",
        duration=_DURATION,
        reference=HOLD,
        simulator={"engine": engine, "rate": _COARSE, "initial_position": [0.0]},
        controller={"law": "p", "gains.height.p": _STIFFNESS},
    )
    run = runner.run(case).recording
    rest = _TARGET - _GRAVITY / _STIFFNESS
    return np.column_stack((run.position[:, 0] - rest, run.velocity[:, 0]))


def _exact() -> RigidBodyMotion:
    """The brick's motion in continuous time, without gravity, at the times of `_FINE`."""
    nowhere = np.zeros((1, 3))
    start = RigidBodyMotion(nowhere, rotations.exp(nowhere), nowhere, np.array([_SPIN]))
    times = np.arange(round(_DURATION * _FINE) + 1) / _FINE
    return move(RigidBody(_BRICK.mass, _BRICK.inertia), start, (), times)


def _row(
    name: str,
    rate: int,
    motion: Tumbling,
    exact: RigidBodyMotion,
    runs: Mapping[str, Mapping[int, RigidBodyMotion]],
) -> Row:
    """How far it is off at the end; and of a rule, how far each engine's ticks are off it."""
    energy, momentum = motion.changes()
    last = rotations.normalised(motion.turn_xyzw[-1])
    row: dict[str, object] = {
        "step": name,
        "rate (Hz)": rate,
        _OFF: float(rotations.angle_between(last, exact.turn_xyzw[-1])),
        "E off": float(np.abs(energy).max()),
        "L off": float(momentum.max()),
        "|q|": float(np.linalg.norm(motion.turn_xyzw[-1])),
    }
    for engine, by_rate in runs.items():
        rule = TURN_RULES.get(name)
        off = None if rule is None else float(ticks_off(rule, by_rate[rate], 1.0 / rate).max())
        row[f"{engine} off (rad)"] = off
    return row


def _add_remarks(result: StudyResult, ways: Ways) -> None:
    longest = float(np.linalg.norm(ways["not normalised"][_COARSE].turn_xyzw[-1]))
    result.remarks += [
        "explicit Euler feeds a spring: its energy grows by 1 + (h w)^2 a step; the semi-implicit "
        "one's wavers by about h w / 2, and for ever",
        f"off in the table: of the turn after {_DURATION:g} s from the exact one; of energy E and "
        "angular momentum L as shares; of each engine's ticks from those of the rule",
        f"not normalised q turns the same, but is {longest:.2f} long after {_DURATION:g} s at "
        f"{_COARSE} Hz, and its matrix makes all {longest**2:.2f} times as large",
    ]
    for engine in INSTALLED_ENGINES:
        column = f"{engine} off (rad)"
        rows = [
            row for row in result.rows if row["rate (Hz)"] == _SHOWN and row[column] is not None
        ]
        best = min(rows, key=lambda row: float(row[column]))
        result.remarks.append(
            f"{engine} does: semi-implicit, {best['step']}; its ticks are off that by "
            f"{best[column]:.1e} rad at {_SHOWN} Hz"
        )


def _draw(
    result: StudyResult,
    ways: Ways,
    runs: Mapping[str, Mapping[int, RigidBodyMotion]],
    swings: Mapping[str, FloatArray],
) -> None:
    spring, fall, lengths, off, energies, bars = result.add_panels(result.name, 2, 3, (14.0, 8.0))
    _draw_spring(spring, swings)
    _draw_fall(fall, runs)
    for rate in _RATES[:3]:
        turning = ways["not normalised"][rate]
        length = np.linalg.norm(turning.turn_xyzw, axis=1)
        lengths.plot(turning.times, length, label=f"not normalised, {rate} Hz")
    lengths.axhline(1.0, **THEORY, label="normalised, exponential map")
    label(lengths, "time (s)", "|q|", "q + h/2 ω q is longer than q")
    steps = 1.0 / np.array(_RATES)
    for name in ways:
        values = [row[_OFF] for row in result.rows if row["step"] == name]
        style = "x--" if name in runs else "o-"
        off.loglog(steps, values, style, label=name, fillstyle="none", linewidth=1.0)
        energy, momentum = ways[name][_SHOWN].changes()
        if name in ("explicit", "exponential map"):
            (line,) = energies.plot(ways[name][_SHOWN].times, energy, label=f"E: {name}")
            color = line.get_color()
            energies.plot(ways[name][_SHOWN].times, momentum, ":", color=color, label="L")
    off.loglog(steps, 8.0 * steps, **THEORY, label="~ h")
    label(
        off,
        "step h (s)",
        "turn off the exact one (rad)",
        f"a tumbling brick after {_DURATION:g} s",
        legend=None,
    )
    off.legend(fontsize="x-small")
    first = ways[INSTALLED_ENGINES[0]][_SHOWN]
    energies.plot(first.times, first.changes()[0], **THEORY, label=f"E: {INSTALLED_ENGINES[0]}")
    title = f"energy and |L - L(0)|, {_SHOWN} Hz"
    label(energies, "time (s)", "change (share)", title, legend=None)
    energies.legend(fontsize="x-small", ncols=2)
    _draw_ticks(bars, result)


def _draw_spring(axes: Axes, swings: Mapping[str, FloatArray]) -> None:
    start = (_GRAVITY / _STIFFNESS - _TARGET, 0.0)
    count = round(_DURATION * _COARSE)
    times = np.arange(count + 1) / _COARSE
    for name, explicit in (("explicit", True), ("semi-implicit", False)):
        states = swing(_FREQUENCY, start, 1.0 / _COARSE, count, explicit=explicit)
        energy = swing_energy(_FREQUENCY, states)
        axes.semilogy(times, energy / energy[0], label=name, linewidth=2.5, alpha=0.7)
    for engine, style in zip(swings, ("k--", "k:"), strict=False):
        energy = swing_energy(_FREQUENCY, swings[engine])
        axes.semilogy(times, energy / energy[0], style, linewidth=1.0, label=engine)
    label(axes, "time (s)", "energy / first", f"1 kg on a spring, {_COARSE} Hz")


def _draw_fall(axes: Axes, runs: Mapping[str, Mapping[int, RigidBodyMotion]]) -> None:
    count = round(_DURATION * _COARSE)
    times = np.arange(count + 1) / _COARSE
    for name, explicit in (("explicit", True), ("semi-implicit", False)):
        above = fall_off(_GRAVITY, 1.0 / _COARSE, times, explicit=explicit)
        axes.plot(
            times, above, label=f"{name}: {'+' if explicit else '-'} g h t / 2", linewidth=2.5
        )
    for engine, style in zip(runs, ("k--", "k:"), strict=False):
        height = runs[engine][_COARSE].centre[:, 2]
        axes.plot(times, height - height[0] + 0.5 * _GRAVITY * times**2, style, label=engine)
    label(axes, "time (s)", "height above - g t² / 2 (m)", f"a falling point, {_COARSE} Hz")


def _draw_ticks(axes: Axes, result: StudyResult) -> None:
    """How far each engine's ticks are off each rule."""
    rows = [row for row in result.rows if row["rate (Hz)"] == _SHOWN and row["step"] in TURN_RULES]
    names = [str(row["step"]).replace(" ", "\n") for row in rows]
    for number, engine in enumerate(INSTALLED_ENGINES):
        values = [max(row[f"{engine} off (rad)"], _SMALLEST_DRAWN) for row in rows]
        places = np.arange(len(rows)) + 0.4 * (number - 0.5)
        axes.bar(places, values, 0.4, label=engine)
    axes.set_yscale("log")
    axes.set_xticks(np.arange(len(rows)), names, fontsize="x-small")
    label(axes, "", "engine's tick off the rule's (rad)", f"which the engines do, {_SHOWN} Hz")
