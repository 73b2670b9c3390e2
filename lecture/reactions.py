"""A character that is hit by balls: how far it gives way, and how it comes back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.stills import pose_strip, strip
from actuated_characters.report.charts import Marks
from actuated_characters.report.events import Event, mode_events, throw_events
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import WALK, RunSpec, StudyRunner
from lecture.framework.tracking import joint_errors
from msgs_config.arrays import FloatArray

TITLE = "a walk that is hit by a ball against the chest, behaviour reactive"
RUNS = 7

IMPULSES = (5.0, 10.0, 20.0, 40.0)  # N s
HIT = 1.0  # s

_SPEED = 8.0  # m/s
_LENGTH, _LONG = 4.0, 8.0  # s, of the runs; of those that fall and get up
_RAGDOLL_HIT = 0.15  # s: later it is out of the ball's way
_MOMENTUM_SPAN = 0.05  # s before and after the hit between which the ball's momentum is compared
_AS_BEFORE = 1.1  # times the largest error without a hit
_PEAK = 1.5  # s after the hit in which the root's largest displacement is looked for
_TILE = (162, 270)  # pixels
_CAPTURED = "the captured motion"
_MODES = ("REACT", "BLEND", "LIMP")
_POSES = {  # what is seen of each run, and when, s
    "ragdoll": (
        "ragdoll, 40 N s: no torque but that of the soft limits, no assistance",
        (0.0, 0.1, 0.15, 0.25, 0.4, 0.6, 0.9, 3.0),
    ),
    "active_ragdoll": (
        "active ragdoll, 40 N s: limp and without assistance, which comes back as it gets up",
        (0.9, 1.05, 1.4, 1.9, 3.0, 4.0, 5.0, 6.5),
    ),
    "reactive": (
        "reactive, 20 N s: soft, with at most 0.2 of the weight, then along the clip that was "
        "found",
        (0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.25, 3.0),
    ),
}


@dataclass(frozen=True)
class HitEffects:
    """The effects of a hit."""

    impulse: float  # N s, that the ball has lost until shortly after it touched
    peak: float  # m, how far the root is at the most from where it would have been
    back: float | None  # s after the hit; None if the joints never are as near to the clip again
    displacement: FloatArray  # (t + 1,) m
    error: FloatArray  # (t + 1,) rad, mean of the joints, from the clip at that time


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Hit the walking humanoid harder and harder against the chest, from in front.

    And two others: one that is limp, and one that gets up.
    """
    strongest = IMPULSES[-1]
    alone = runner.run(_case("alone", "reactive", length=_LONG)).recording
    hits = {}
    for impulse in IMPULSES:
        length = _LONG if impulse == strongest else _LENGTH
        case = _case(f"reactive_{impulse:g}Ns", "reactive", impulse, length=length)
        hits[impulse] = runner.run(case).recording
    limp = _case("ragdoll", "ragdoll", strongest, at=_RAGDOLL_HIT, distance=1.0)
    rising = _case("active_ragdoll", "active_ragdoll", strongest, length=_LONG)
    poses = {case.label: runner.run(case).recording for case in (limp, rising)}
    reactions = {impulse: measure(hit, alone, HIT) for impulse, hit in hits.items()}
    for impulse, reaction in reactions.items():
        result.rows.append(_row(impulse, reaction, hits[impulse]))
        curves = {"root_displacement_m": reaction.displacement, "joint_error_rad": reaction.error}
        result.add_curves(f"{result.name}_{impulse:g}Ns", {"time_s": hits[impulse].times, **curves})
    _draw(result, alone, hits, reactions)
    for name, recording in {**poses, "reactive": hits[20.0]}.items():
        title, times = _POSES[name]
        pictures = {title: strip(recording, times)}
        if name == "reactive":
            pictures = _beside(alone, recording, title, times)
        result.add_pictures(
            f"{result.name}_{name}", pictures, title_height=0.4, title_place="center"
        )
    result.remarks.append(
        "assistance: full while it follows a clip, at most 0.2 of the weight in REACT, "
        "none in LIMP; the ragdoll has none"
    )


def _beside(
    alone: Recording, hit: Recording, title: str, times: Sequence[float]
) -> dict[str, Picture]:
    """The captured motion and, below it at the same times, the reaction.

    As Zordan et al. 2005, "Dynamic Response for Motion Capture Animation", show theirs.
    """
    rows = np.searchsorted(alone.times, times)
    captions = [f"{time:.2f} s" for time in times]
    captured = pose_strip(
        alone.character, alone.reference_position[rows], captions, columns=len(rows), size=_TILE
    )
    return {_CAPTURED: captured, title: strip(hit, times, columns=len(rows), size=_TILE)}


def _row(planned: float, reaction: HitEffects, run: Recording) -> Row:
    modes = mode_events(run)
    lasting = {
        f"{mode} (s)": sum((each.duration for each in modes if each.label == mode), start=0.0)
        for mode in _MODES
    }
    return {
        "planned impulse (N s)": planned,
        "measured impulse (N s)": reaction.impulse,
        "largest displacement of the root (m)": reaction.peak,
        "back on the clip (s)": reaction.back,
        **lasting,
    }


def measure(run: Recording, alone: Recording, hit: float) -> HitEffects:
    """The effects of a hit at a time in s, by comparison with the same run without it.

    Args:
        run: A run of one ball.
        alone: One without, as long or longer.
        hit: When it touches, s.
    """
    states = slice(len(run.times))
    error = joint_errors(run, alone.reference_position[states]).mean(axis=1)
    usual = joint_errors(alone, alone.reference_position).mean(axis=1)[alone.times >= hit]
    displacement = np.linalg.norm(run.position[:, :3] - alone.position[states, :3], axis=1)
    times, after = run.times, run.times >= hit
    # The last state has no error.
    is_off = np.flatnonzero(after & (error > _AS_BEFORE * np.nanmax(usual)))
    last = int(is_off[-1]) if len(is_off) else None
    back: float | None = 0.0
    if last is not None:
        back = None if last == len(times) - 1 else float(times[last + 1]) - hit
    return HitEffects(
        impulse=lost_momentum(run, hit),
        peak=float(displacement[after & (times <= hit + _PEAK)].max()),
        back=back,
        displacement=displacement,
        error=error,
    )


def lost_momentum(run: Recording, hit: float) -> float:
    """Momentum in N s that the only ball has lost around a time in s, without gravity's part."""
    before, after = np.searchsorted(run.times, (hit - _MOMENTUM_SPAN, hit + _MOMENTUM_SPAN))
    motions = [run.balls[row] for row in (before, after)]
    (throw,) = [throw for each in run.throws for throw in each]
    if any(motion is None for motion in motions):
        return 0.0
    first, last = (motion.motion[0, 7:10] for motion in motions if motion is not None)
    time = float(run.times[after] - run.times[before])
    fall = np.array((0.0, 0.0, -float(run.parameters["gravity"]) * time))
    return float(throw.mass * np.linalg.norm(last - first - fall))


def _case(
    label: str,
    behaviour: str,
    impulse: float = 0.0,
    *,
    at: float = HIT,
    distance: float = 2.0,
    length: float = _LENGTH,
) -> RunSpec:
    throw = f"mass={impulse / _SPEED} speed={_SPEED} at={at} from=front target=chest"
    return RunSpec(
        label,
        "humanoid",
        length,
        WALK,
        controller={"behaviour": behaviour},
        throws=[f"{throw} distance={distance}"] if impulse else [],
    )


def _draw(
    result: StudyResult,
    alone: Recording,
    hits: Mapping[float, Recording],
    reactions: Mapping[float, HitEffects],
) -> None:
    """Two panels an impulse: the root's displacement and the joint error, and the modes."""
    title = "hit against the chest at 1 s; the assistance is full in TRACK and BLEND"
    panels = result.add_panels(result.name, len(hits), 2, (11.0, 9.0), title=title, same_x="row")
    events: list[Event] = []  # those of all hits, for the legend
    usual = joint_errors(alone, alone.reference_position).mean(axis=1)
    for (impulse, run), (moved, error) in zip(
        hits.items(), zip(panels[::2], panels[1::2], strict=True), strict=True
    ):
        reaction = reactions[impulse]
        marks = Marks([*throw_events(run), *mode_events(run)])
        events += marks.events
        moved.plot(run.times, reaction.displacement)
        moved.set_ylabel("root moved (m)")
        moved.set_title(f"{impulse:g} N s", fontsize="medium", loc="left")
        error.plot(run.times, reaction.error, label="hit")
        error.plot(run.times, usual[: len(run.times)], "k--", label="not hit")
        error.set_ylabel("joint error (rad)")
        for panel in (moved, error):
            panel.set_ylim(bottom=0.0)
            panel.grid(alpha=0.3)
            marks.draw(panel, filled=False)
    for panel in panels[-2:]:
        panel.set_xlabel("time (s)")
    panels[1].legend(fontsize="small")
    Marks(events).explained(result.figures[result.name])
