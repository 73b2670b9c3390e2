"""What is to be trained, and what its training may begin with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from actuated_characters.runs.plan import RunPlan
from actuated_characters.training.entries import Entries
from actuated_characters.training.exercises import Exercise
from actuated_characters.training.references import TrainedReference, frames_ahead
from actuated_characters.training.worlds import action_unit, hold_ticks
from controller_node.control_laws import GainArrays
from controller_node.controller_settings import ControllerSettings, check_planned
from controller_node.parameters import make_controller_settings
from controller_node.planner.policy.file import Policy
from controller_node.planner.settings import PREDICTIVE, PlannerSettings, make_planner_settings
from controller_node.references.steering.factory import GaitSettings, clips_of_gait
from controller_node.tracked_reference import TrackedReference
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.messages.clock import TickClock
from msgs_config.parameters import Values

HIDDEN = 128
"""Units of each of a policy's two layers, where nothing else is said."""
_OWN = ("reference", "clip", "steering.")  # parameters, by how they begin, that differ by exercise


@dataclass(frozen=True)
class Job:
    """What is to be trained."""

    character: Character
    references: Sequence[TrainedReference]
    names: tuple[str, ...]  # of the exercises
    settings: PlannerSettings
    gains: GainArrays
    decisions: int
    most_push: float  # N s
    seed: int
    threads: int
    after: tuple[str, ...] = ()  # what else its motions begin after
    hidden: int = HIDDEN  # units of each of the policy's two layers
    gait: tuple[str, ...] = ()  # the clips by which it is steered, sorted
    teachers: tuple[Policy | None, ...] = ()  # of the exercises, which are the first references


def make_job(
    exercises: Sequence[Exercise],
    controller: Mapping[str, object],
    *,
    decisions: int,
    most_push: float = 0.0,
    seed: int = 0,
    threads: int = 1,
    after: Sequence[str] = (),
    hidden: int = HIDDEN,
) -> Job:
    """The job of some exercises of one character; `controller` has the controller's parameters.

    `after` are clips, and `FALL`, after which each of them begins, too: see `Entries`.

    Raises:
        ActuatedCharactersError: a name or a value is wrong, a planner cannot work with it, or what
            one clip was reconstructed with is not what the first one needs.
    """
    given = {**controller, "planner": PREDICTIVE, "plan.workers": 1}
    plans = [each.plan(each.cycle_s, {}, given, seed)[0] for each in exercises]
    character, values = plans[0].character, plans[0].controller
    for exercise, plan in zip(exercises[1:], plans[1:], strict=True):
        _check_same(exercise, values, plan.controller)
    settings = make_controller_settings(character, values)
    check_planned(settings)
    references = [
        TrainedReference(_tracked(plan, settings), each.cycle_s, each.wraps)
        for plan, each in zip(plans, exercises, strict=True)
    ]
    for exercise, plan in zip(exercises, plans, strict=True):
        entries = Entries(exercise, plan, seed, follows_velocity=settings.follows_velocity)
        references += [entry for name in after for entry in entries.after(name)]
    return Job(
        character,
        references,
        tuple(each.name for each in exercises),
        make_planner_settings(character, values),
        settings.gains,
        decisions,
        most_push,
        seed,
        threads,
        tuple(after),
        hidden,
        _gait(exercises, plans),
    )


def taught_by(job: Job, teachers: Sequence[Policy]) -> Job:
    """The same job with policies that its own imitates at first, the first that knows an exercise.

    Raises:
        ConfigurationError: one was trained or is steered otherwise, or knows none of the exercises.
    """
    known = [[Path(clip).stem for clip in each.about["clips"]] for each in teachers]
    wanted = [Path(name).stem for name in job.names]
    for teacher, clips in zip(teachers, known, strict=True):
        check_alike(job, teacher, f"the policy of {', '.join(clips)}")
        gait = tuple(teacher.about.get("gait", job.gait))
        if job.gait and gait != job.gait:
            raise ConfigurationError(
                f"the policy to imitate was steered by {', '.join(gait)}; here it is by "
                f"{', '.join(job.gait)}"
            )
        if not set(clips) & set(wanted):
            raise ConfigurationError(
                f"the policy to imitate was trained on {', '.join(clips)}, none of which is "
                f"trained here: {', '.join(wanted)}"
            )
    pairs = list(zip(teachers, known, strict=True))
    of_each = (next((one for one, clips in pairs if name in clips), None) for name in wanted)
    return replace(job, teachers=tuple(of_each))


def _gait(exercises: Sequence[Exercise], plans: Sequence[RunPlan]) -> tuple[str, ...]:
    clips = [
        clips_of_gait(plan.character, GaitSettings.of(plan.controller))
        for exercise, plan in zip(exercises, plans, strict=True)
        if exercise.is_steered
    ]
    return tuple(sorted(Path(clip).stem for each in clips for clip in each))


def _check_same(exercise: Exercise, first: Values, values: Values) -> None:
    """Raise ConfigurationError if an exercise brings another value than the first one."""
    for name in first:
        if not name.startswith(_OWN) and values[name] != first[name]:
            raise ConfigurationError(
                f"{exercise.name} was made with '{name}' {values[name]}, the first one with "
                f"{first[name]}; one policy takes clips that were made with the same"
            )


def _tracked(plan: RunPlan, settings: ControllerSettings) -> TrackedReference:
    """The reference of a run as its controller would track it, from the first tick on."""
    clock = TickClock(plan.simulation.rate_hz)
    tracked = TrackedReference(plan.character, plan.reference, clock, episode_ns=0)
    tracked.follows_velocity = settings.follows_velocity
    return tracked


def decisions_of(policy: Policy) -> int:
    """How many decisions a policy was trained with."""
    return int(policy.about["trained"].get("decisions", 0))


def check_resumed(job: Job, start: Policy) -> None:
    """Raise ConfigurationError if a policy's training cannot go on as a job."""
    before, now = ([Path(name).stem for name in each] for each in (start.about["clips"], job.names))
    clips, names = ", ".join(before), ", ".join(now)
    if before != now:
        raise ConfigurationError(
            f"the policy's clips: {clips}, this training's: {names}; --resume goes on with the "
            "same, --from begins with what a policy of other clips can"
        )
    after, wanted = ", ".join(start.about["trained"].get("after", [])), ", ".join(job.after)
    if after != wanted:
        raise ConfigurationError(
            f"the policy was trained --after: {after or 'nothing'}, this training's: "
            f"{wanted or 'nothing'}; --resume goes on with the same"
        )
    if decisions_of(start) >= job.decisions:
        raise ConfigurationError(
            f"the policy was trained with {decisions_of(start):,} decisions, and all --minutes "
            f"are {job.decisions:,}; --resume goes on with more"
        )


def check_start(job: Job, start: Policy) -> None:
    """Raise ConfigurationError if a job cannot begin with a policy."""
    check_alike(job, start)
    _check_equal("the policy's --hidden", len(start.network.bias_1), job.hidden)


def check_alike(job: Job, start: Policy, what: str = "the policy") -> None:
    """Raise ConfigurationError if a policy is not told, or does not answer, as that of a job."""
    rate = job.settings.parameters.rate_hz
    _check_equal(f"{what}'s rate", start.rate_hz, rate)
    _check_equal(f"{what}'s hold", start.hold, hold_ticks(rate))
    _check_equal(f"{what}'s frames ahead", start.ahead.tolist(), frames_ahead(rate).tolist())
    for name, given, own in (
        ("sigma", start.unit, action_unit(job.settings)),
        ("stiffness", start.stiffness[6:], job.gains.stiffness[6:]),  # no force acts on the root
        ("damping", start.damping[6:], job.gains.damping[6:]),
    ):
        if not np.array_equal(given, own):
            raise ConfigurationError(f"{what} was trained with another {name}; it must be the same")


def _check_equal(name: str, found: object, wanted: object) -> None:
    if found != wanted:
        raise ConfigurationError(f"{name}: {found}, this training's: {wanted}; it must be the same")
