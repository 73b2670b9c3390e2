"""A step of the pose under small, normal and large gains: overshoot, sag and creeping."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.plots import THEORY, label
from actuated_characters.render.stills import GAP, pose_strip
from lecture.framework.result import StudyResult
from lecture.framework.study import RunSpec, StudyRunner
from lecture.theory import second_order
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character

Factors = tuple[float, float]
"""Of stiffness and damping."""

MEASURED = "right_hip_z"  # lifts the straight leg
RATE = 240  # Hz

_DOFS = (MEASURED, "right_shoulder_z", "left_shoulder_z")
_LIFTED = ("right_hip", "right_knee", "right_ankle", "right_s", "right_e", "left_s", "left_e")
_SIZE, _AT, _DURATION = 0.6, 0.25, 3.0  # rad, s, s
_POSES = (0.0, 0.35, 0.5, 0.65, 0.8, 1.0, 1.5, 2.9)  # s of the pictures
_TILE = (145, 190)  # pixels
_NO_LIMIT = "1e6"  # N m
_STILL_SPAN = 0.5  # s at the end, whose mean is where it comes to rest


@dataclass(frozen=True)
class Step:
    """The leg's answer to a step of the pose."""

    times: FloatArray  # (t,) s since the step
    angle: FloatArray  # (t,) of the hip, rad
    theory: FloatArray  # (t,) that of the body linear about the target, rad

    def overshoot(self, angle: FloatArray) -> float:
        """How far an angle (t,) goes beyond its rest, as a share of the way there."""
        still = angle[self.times >= self.times[-1] - _STILL_SPAN]
        return second_order.measured_overshoot(angle, float(still.mean()))


def run_steps(runner: StudyRunner, every: Sequence[Factors]) -> dict[Factors, Recording]:
    """Lift a leg and both arms of the standing humanoid at once, with each pair of factors."""
    character = _write_strong(runner)
    return {factors: runner.run(_case(character, factors)).recording for factors in every}


def _case(character: str, factors: Factors) -> RunSpec:
    p, d = factors
    reference = {
        "reference": "step",
        "signal.dofs": list(_DOFS),
        "step.size": _SIZE,
        "step.time": _AT,
    }
    gains = {"gain_scale.p": p, "gain_scale.d": d}
    return RunSpec(f"step_p{p:g}_d{d:g}", character, _DURATION, reference, {"rate": RATE}, gains)


def _write_strong(runner: StudyRunner) -> str:
    """Write the humanoid with motors that are never at their limits; returns its path.

    So what is seen is the law: an effort at its limit is not that of the gains.
    """
    text = load_character("humanoid").file.read_text(encoding="utf-8")
    path = runner.path("strong_humanoid.yaml")
    strong = re.sub(r"effort_limit: [\d.]+", f"effort_limit: {_NO_LIMIT}", text)
    path.write_text(strong, encoding="utf-8")
    return str(path)


def measure(run: Recording, factors: Factors) -> Step:
    """The hip's angle from the step on, and that by theory."""
    entry = run.layout.dof_names.index(MEASURED)
    since = run.times >= _AT
    times = run.times[since] - _AT
    target = run.reference_position[-2]
    theory = linear_response(run.character, target, run.position[since][0], factors, len(times))
    return Step(times, run.position[since, entry], theory[:, entry])


def linear_response(
    character: Character, target: FloatArray, start: FloatArray, factors: Factors, count: int
) -> FloatArray:
    """Positions (count, n) of the whole body by stable PD, linear about the target.

    The law's own recurrence (Tan, Liu and Turk 2011), with the mass matrix M of the target, and the
    weight g of the limbs that are lifted; the ground, which carries the rest, does nothing else:
    `(M + h Kd) a = Kp (e - h v) - Kd v - g`, `v+ = v + h a`, `e+ = e - h v+`.

    Args:
        character: Has the gains of factors 1.
        target: Where the references are (n,), message form.
        start: Where it is at rest at first (n,), message form.
        factors: Of the joints' gains.
        count: Of ticks.
    """
    model, layout = DynamicsModel(character), character.layout
    model.update(target, np.zeros(layout.size))
    lifted = np.array([name.startswith(_LIFTED) for name in layout.dof_names])
    weight, step = model.gravity_force() * lifted, 1.0 / RATE
    stiffness, damping = _gains(character, factors)
    inverse = np.linalg.inv(model.mass_matrix() + step * np.diag(damping))
    error = layout.difference(layout.configuration(start), layout.configuration(target))
    velocity, errors = np.zeros(layout.size), []
    for _ in range(count):
        errors.append(error)
        wanted = stiffness * (error - step * velocity) - damping * velocity
        velocity = velocity + step * (inverse @ (wanted - weight))
        error = error - step * velocity
    return target - np.array(errors)


def _gains(character: Character, factors: Factors) -> tuple[FloatArray, FloatArray]:
    """Stiffness and damping (n,), those of the joints times the factors."""
    layout = character.layout
    both = np.zeros((2, layout.size))
    for joint in layout.joints:
        if joint.type is not JointType.FLOATING:
            gains = character.gains[joint.name]
            scaled = gains.stiffness * factors[0], gains.damping * factors[1]
            both[:, joint.entries] = np.array(scaled)[:, np.newaxis]
            continue
        for entries, name in zip(joint.vectors, (joint.name, f"{joint.name}_r"), strict=True):
            gains = character.gains[name]
            both[:, entries] = np.array((gains.stiffness, gains.damping))[:, np.newaxis]
    return both[0], both[1]


def describe(runs: Mapping[Factors, Recording], named: Mapping[str, Factors]) -> str:
    """The overshoots of all names, each beside that by theory."""
    texts = []
    for name, factors in named.items():
        step = measure(runs[factors], factors)
        found, expected = (100.0 * step.overshoot(angle) for angle in (step.angle, step.theory))
        texts.append(f"{name} {found:.0f} % (linear theory {expected:.0f} %)")
    return ", ".join(texts)


def draw_steps(
    result: StudyResult, named: Mapping[str, Factors], runs: Mapping[Factors, Recording]
) -> None:
    """The hip's angle, a panel for each of the names; and the poses."""
    curves: dict[str, FloatArray] = {}
    panels = result.add_panels("gains_step", 2, 3, (13.0, 7.0), same_x=True)
    for panel, (name, factors) in zip(panels, named.items(), strict=True):
        step = measure(runs[factors], factors)
        panel.plot(step.times, step.angle, linewidth=2.0, alpha=0.8, label="right hip")
        panel.plot(step.times, step.theory, **THEORY, label="theory: linear")
        panel.axhline(_SIZE, color="black", linewidth=0.8, label="target")
        title = f"{name}: overshoot {step.overshoot(step.angle):.0%}"
        label(panel, "time since the step (s)", "lifted by (rad)", title, legend=None)
        panel.set_ylim(-0.2, 1.35)
        curves |= {"time_s": step.times, f"{name.replace(' ', '_')}_rad": step.angle}
    panels[0].legend(loc="upper right", fontsize="small")
    result.add_curves("gains_step", curves)
    titles = [f"{name}; the target an outline" for name in named]
    states = [(runs[factors], time) for factors in named.values() for time in _POSES]
    captions = [f"{time:.2f} s" for _, time in states]
    rows = _draw(states, captions, parts=len(named), columns=len(_POSES), size=_TILE)
    result.add_pictures("gains_step_poses", dict(zip(titles, rows, strict=True)))


def _draw(
    states: Sequence[tuple[Recording, float]],
    captions: Sequence[str],
    *,
    parts: int,
    columns: int,
    size: Size,
) -> list[Picture]:
    """Pictures of runs at times in s, in rows of so many columns, cut into equal parts.

    They are drawn in one go, for that needs one skin, and has one scale.
    """
    rows = [
        (run, int(np.searchsorted(run.times, min(time, run.times[-2])))) for run, time in states
    ]
    whole = pose_strip(
        states[0][0].character,
        np.array([run.position[row] for run, row in rows]),
        captions,
        ghosts=np.array([run.reference_position[row] for run, row in rows]),
        columns=columns,
        size=size,
    )
    tall = (len(whole) + GAP) // parts  # of a part, with what is below it
    return [whole[number * tall : (number + 1) * tall - GAP] for number in range(parts)]


def film(
    named: Mapping[str, Factors],
    runs: Mapping[Factors, Recording],
    fps: int,
    *,
    size: Size = (200, 250),
    columns: int = 3,
) -> list[Picture]:
    """Pictures (h, w, 3) of all figures beside each other, their targets outlines, of one scale.

    Args:
        named: What stands above each figure, and its factors.
        runs: Those of `run_steps`.
        fps: Pictures a second.
        size: Width and height of each figure, pixels.
        columns: Figures in a row.
    """
    end = min(float(run.times[-2]) for run in runs.values())
    times = np.arange(0.0, end, 1.0 / fps).tolist()
    states = [(runs[factors], time) for time in times for factors in named.values()]
    captions = [name for _ in times for name in named]
    return _draw(states, captions, parts=len(times), columns=columns, size=size)
