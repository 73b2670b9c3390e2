"""What a timeline's file says beside the motion: how it is run, and what is sent, and when."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.runs.plan import SHARED, RunPlan, count_ticks, make_plan
from actuated_characters.runs.planned.behaviours import PlannedBehaviour
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.pins import PlannedPin
from actuated_characters.runs.planned.strengths import PlannedStrengths
from actuated_characters.runs.planned.throw_requests import parse_throw
from actuated_characters.runs.planned.throws import PlannedThrow, plan_throw
from actuated_characters.runs.planned.wrenches import PlannedPush, plan_push
from controller_node.behaviours.asked import ASKABLE, Ask
from controller_node.planner.settings import NO_PLANNER, PREDICTIVE
from controller_node.references.timeline.description import (
    BehaviourEntry,
    Entry,
    PinEntry,
    Point,
    PushEntry,
    StrengthEntry,
    Timeline,
)
from controller_node.references.timeline.file import read_timeline
from controller_node.references.timeline.motion import TimelineReference
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.errors import ActuatedCharactersError, ConfigurationError, MotionError, one_of
from msgs_config.messages.clock import TickClock
from msgs_config.shared_parameters import collides
from sim_node.node_settings import NodeSettings

_STEP = 0.009  # s, two ticks of 240 Hz: planning takes half of the time, and edits are seen sooner
_AFTERWARDS = 1.0  # s that a run goes on when all of a timeline is over


@dataclass(frozen=True)
class TimelineRun:
    """A run that does what a timeline says."""

    plan: RunPlan
    inputs: PlannedInputs
    warnings: Sequence[str]

    @property
    def reference(self) -> TimelineReference:
        """What is tracked."""
        assert isinstance(self.plan.reference, TimelineReference)
        return self.plan.reference


def plan_timeline(
    name: str,
    simulator: Mapping[str, object],
    controller: Mapping[str, object],
    *,
    character: str | None = None,
    duration: float | None = None,
) -> TimelineRun:
    """Plan the run of a timeline; what is given takes precedence over what the file says.

    Args:
        name: A shipped timeline, or the path of a file.
        simulator: Parameters of `sim_node`, by name.
        controller: Parameters of `controller_node`, by name.
        character: A name or path.
        duration: s; without any, the run lasts until all of the timeline is over, and a bit.

    Raises:
        ActuatedCharactersError: names the entry that cannot be, and why.
    """
    timeline, own, other = read_timeline(name), dict(simulator), dict(controller)
    whose = character or timeline.character
    loaded = load_character(whose, collides(own | other))
    between = _set_parameters(timeline, loaded, own, other)
    duration = timeline.duration if duration is None else duration
    reference = {"reference": "timeline", "timeline": name}
    plan = make_plan(whose, duration or _AFTERWARDS, reference, own, other, loaded=loaded)
    if duration is None:
        plan = plan.lasting(count_ticks(_default_duration(plan), plan.simulation.rate_hz))
    return _with_events(plan, timeline, between)


def _set_parameters(
    timeline: Timeline,
    character: Character,
    simulator: dict[str, object],
    controller: dict[str, object],
) -> Ask:
    """Set what a timeline says of the nodes' parameters, unless it is set.

    One that says no planner has `predictive` for a character that stands by itself, which plans in
    longer steps where no behaviour may let the character fall: getting up needs all ticks. Returns
    what is asked for between the behaviours of its track: all that the run's behaviour does, where
    one is said; else to track.
    """
    run = dict(timeline.run)
    if not timeline.behaviours and "behaviour" not in {**run, **controller}:
        run["plan.step"] = _STEP
    if not character.layout.has_floating_base or not character.feet:
        run.setdefault("planner", NO_PLANNER)
    run.setdefault("planner", PREDICTIVE)
    taken = {name for name in SHARED if name in simulator or name in controller}
    own = timeline.settings
    for given, brought in (
        (simulator, own.get("sim_node", {})),
        (controller, {**run, **own.get("controller_node", {})}),
    ):
        given.update({name: brought[name] for name in brought if name not in (*given, *taken)})
    if not timeline.behaviours or "behaviour" in controller:
        return Ask.REACT
    controller["behaviour"] = ASKABLE[0]
    return Ask.TRACK


def _default_duration(plan: RunPlan) -> float:
    """The length in s of a run of a timeline that says none: until all of it is over, and a bit."""
    assert isinstance(plan.reference, TimelineReference)
    timeline = plan.reference.timeline
    over = [plan.reference.still]
    over += [each.until for each in timeline.strengths]
    over += [each.until for each in timeline.pins]
    over += [each.at + (each.duration or 0.0) for each in timeline.pushes]
    over += [each.at for each in timeline.throws]
    over += [each.at if each.until is None else each.until for each in timeline.behaviours]
    return max(over) + _AFTERWARDS


def _with_events(plan: RunPlan, timeline: Timeline, between: Ask) -> TimelineRun:
    """The run of a plan, with the events of its timeline; `between` as of `_set_parameters`."""
    warnings = list(plan.warnings)
    pushes = [push for entry in timeline.pushes for push in _pushes(plan, entry)]
    throws: list[PlannedThrow] = []
    for entry in timeline.throws:
        text = " ".join(f"{key}={_written(value)}" for key, value in entry.request.items())
        try:
            throw, in_the_way = plan_throw(plan, parse_throw(text))
        except ActuatedCharactersError as error:
            raise MotionError(f"{entry.place}: {error}") from error
        throws.append(throw)
        warnings += [f"{entry.place}: {line}" for line in in_the_way]
    strengths = _strengths(plan, timeline.strengths)
    pins = _pins(plan, timeline.pins)
    behaviours = _behaviours(plan, timeline.behaviours, between)
    inputs = PlannedInputs(pushes, throws, strengths=strengths, pins=pins, behaviours=behaviours)
    return TimelineRun(plan, inputs, warnings)


def _written(value: object) -> str:
    """A value of a throw as `run --throw` has it."""
    if isinstance(value, list):
        return "x".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _pushes(plan: RunPlan, entry: PushEntry) -> list[PlannedPush]:
    """A push, as one after another of the simulator's `wrench_duration`."""
    rate, ticks = plan.simulation.rate_hz, NodeSettings.of(plan.simulator).push_ticks
    whole = ticks if entry.duration is None else round(entry.duration * rate)
    if whole < ticks or whole % ticks:
        raise MotionError(
            f"{entry.place}: for is {entry.duration:g} s; it must be a multiple of "
            f"{ticks / rate:g} s, the parameter sim_node.wrench_duration"
        )
    try:
        first = plan_push(plan, entry.link, entry.force, entry.at)
    except ConfigurationError as error:
        raise MotionError(f"{entry.place}: {error}") from error
    clock = TickClock(rate)
    begin = clock.tick(first.stamp_ns)
    return [
        replace(first, stamp_ns=clock.stamp_ns(tick))
        for tick in range(begin, begin + whole, ticks)
        if tick <= plan.ticks
    ]


def _pins(plan: RunPlan, entries: Sequence[PinEntry]) -> list[PlannedPin]:
    """What holds and lets go, by the links' names; a link is held to one point at a time."""
    rate, clock = plan.simulation.rate_hz, TickClock(plan.simulation.rate_hz)
    links = [link.name for link in plan.character.links]
    planned = list[PlannedPin]()
    for link in sorted({entry.link for entry in entries}):
        own = sorted((each for each in entries if each.link == link), key=lambda each: each.at)
        for entry, after in zip(own, (*own[1:], None), strict=True):
            _check_within(plan, entry)
            if link not in links:
                raise MotionError(f"{entry.place}: {one_of('link', link, links)}")
            if after is not None and after.at < entry.until:
                raise MotionError(
                    f"{after.place}: at is {after.at:g}; it must be {entry.until:g} s or later, "
                    f"when '{link}' is let go"
                )
            begin, end = round(entry.at * rate), round(entry.until * rate)
            place = _held_place(plan, entry, links.index(link))
            planned.append(PlannedPin(clock.stamp_ns(1 + begin), link, place, entry.force))
            if end < plan.ticks and (after is None or round(after.at * rate) > end):
                planned.append(PlannedPin(clock.stamp_ns(1 + end), link, place, 0.0))
    return planned


def _held_place(plan: RunPlan, entry: PinEntry, link: int) -> Point:
    """Where in the world a link is held, m; without a point where the motion has it then."""
    if entry.point is not None:
        return entry.point
    model, configuration = (
        DynamicsModel(plan.character),
        plan.reference.sample(entry.at).configuration,
    )
    model.update(configuration.position, np.zeros(plan.character.layout.size))
    x, y, z = model.link_frames(np.array([link]))[0][0].tolist()
    return x, y, z


def _strengths(plan: RunPlan, entries: Sequence[StrengthEntry]) -> list[PlannedStrengths]:
    """The strengths at each time at which some change; where several act, their product."""
    rate, joints = plan.simulation.rate_hz, plan.character.layout.actuated_joint_names
    changes: set[int] = set()
    for entry in entries:
        _check_within(plan, entry)
        for name in entry.joints:
            if name not in joints:
                raise MotionError(f"{entry.place}: {one_of('joint', name, list(joints))}")
        changes |= {round(entry.at * rate), round(entry.until * rate)}
    clock, planned = TickClock(rate), list[PlannedStrengths]()
    for tick in sorted(changes):
        values: dict[str, float] = {}
        for entry in entries:
            if round(entry.at * rate) <= tick < round(entry.until * rate):
                for name in entry.joints or joints:
                    values[name] = values.get(name, 1.0) * entry.strength
        if tick < plan.ticks:
            planned.append(PlannedStrengths(clock.stamp_ns(1 + tick), values))
    return planned


def _behaviours(
    plan: RunPlan, entries: Sequence[BehaviourEntry], between: Ask
) -> list[PlannedBehaviour]:
    """What the behaviour is asked for at each time at which that changes."""
    rate, known = plan.simulation.rate_hz, [each.value for each in Ask]
    behaviour = str(plan.controller["behaviour"])
    asked: dict[int, str] = {}  # by tick
    if entries and between is not Ask.REACT:
        asked[0] = between.value
    for entry in entries:
        _check_within(plan, entry)
        if entry.ask not in known:
            raise MotionError(f"{entry.place}: {one_of('do:', entry.ask, known)}")
        if behaviour not in ASKABLE:
            raise MotionError(
                f"{entry.place}: the run's behaviour is {behaviour}, which cannot be asked for "
                f"others; it must be {' or '.join(ASKABLE)}"
            )
        asked[round(entry.at * rate)] = entry.ask  # in place of the end of the one before
        if entry.until is not None:
            asked[round(entry.until * rate)] = between.value
    clock = TickClock(rate)
    return [
        PlannedBehaviour(clock.stamp_ns(1 + tick), ask)
        for tick, ask in asked.items()
        if tick < plan.ticks
    ]


def _check_within(plan: RunPlan, entry: Entry) -> None:
    end = plan.ticks / plan.simulation.rate_hz
    if entry.at >= end:
        raise MotionError(f"{entry.place}: at is {entry.at:g} s; the run ends at {end:g} s")
