"""What the options of `run` describe: a plan, and what is sent in it."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from actuated_characters.commands.common.settings import CHARACTER, NODES, node_settings
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.runs.plan import RunPlan
    from actuated_characters.runs.planned.inputs import PlannedInputs
    from actuated_characters.runs.planned.wrenches import PlannedPush
    from controller_node.references.files.reconstructed import FoundWith
    from msgs_config.character.model import Character

DURATION = 10.0  # s
_NO_PUSH = "none"


@dataclass(frozen=True)
class PlannedRun:
    """A run as the command's options describe it."""

    plan: "RunPlan"
    inputs: "PlannedInputs"
    warnings: Sequence[str]  # sentences that the user should read


def planned_run(options: argparse.Namespace) -> PlannedRun:
    """Plan the run that the options describe; raises ActuatedCharactersError if it cannot be."""
    from msgs_config.character.loading import load_character
    from msgs_config.shared_parameters import collides

    settings = node_settings(options.set, NODES)
    simulator, controller = settings["sim_node"], settings["controller_node"]
    if options.view:
        simulator.setdefault("real_time_factor", 1.0)
    _set_options(options, controller)
    if options.timeline is not None:
        return _run_of_timeline(options, simulator, controller)
    character = load_character(options.character or CHARACTER, collides(simulator | controller))
    return _run_of_motion(options, character, simulator, controller)


def _run_of_motion(
    options: argparse.Namespace,
    character: "Character",
    simulator: dict[str, object],
    controller: dict[str, object],
) -> PlannedRun:
    """A run that tracks a clip, keyframes or another reference."""
    from actuated_characters.runs.brought import bring_parameters
    from actuated_characters.runs.plan import make_plan
    from actuated_characters.runs.planned.inputs import PlannedInputs
    from actuated_characters.runs.planned.throws import plan_throws
    from actuated_characters.runs.planned.velocities import PlannedVelocity, plan_velocities

    found_in = bring_parameters(character, options.clip, simulator, controller)
    duration = options.duration
    if duration is None:
        duration = DURATION if found_in is None else found_in.duration
    reference = _reference(options)
    plan = make_plan(
        options.character or CHARACTER,
        duration,
        reference,
        simulator,
        controller,
        loaded=character,
    )
    velocities: list[PlannedVelocity] = []
    if options.cmd_vel is not None:
        plan, velocities = plan_velocities(plan, options.cmd_vel)
    pushes = _pushes(options.push, plan, found_in)
    throws, in_the_way = plan_throws(plan, options.throw)
    inputs = PlannedInputs(pushes, throws, velocities)
    return PlannedRun(plan, inputs, [*plan.warnings, *in_the_way])


def _run_of_timeline(
    options: argparse.Namespace, simulator: dict[str, object], controller: dict[str, object]
) -> PlannedRun:
    """A run that does what a timeline says; pushes and throws of the options come besides."""
    from actuated_characters.runs.planned.inputs import PlannedInputs
    from actuated_characters.runs.planned.throws import plan_throws
    from actuated_characters.runs.planned.timeline import plan_timeline

    run = plan_timeline(
        options.timeline,
        simulator,
        controller,
        character=options.character,
        duration=options.duration,
    )
    throws, in_the_way = plan_throws(run.plan, options.throw)
    inputs = PlannedInputs(
        [*run.inputs.pushes, *_pushes(options.push, run.plan, None)],
        [*run.inputs.throws, *throws],
        strengths=run.inputs.strengths,
        pins=run.inputs.pins,
        behaviours=run.inputs.behaviours,
    )
    return PlannedRun(run.plan, inputs, [*run.warnings, *in_the_way])


def _set_options(options: argparse.Namespace, controller: dict[str, object]) -> None:
    """Set the controller's parameters of options."""
    for name in ("behaviour", "planner", "collision"):
        _set_option(name, getattr(options, name), controller)
    for option, behaviour in (("machine", "state_machine"), ("onnx", "onnx")):
        given = getattr(options, option)
        if given is None:
            continue
        if options.behaviour not in (None, behaviour):
            raise ConfigurationError(
                f"--{option} goes with --behaviour {behaviour}, not {options.behaviour}"
            )
        _set_option(option, given, controller)
        _set_option("behaviour", behaviour, controller)


def _reference(options: argparse.Namespace) -> dict[str, object]:
    """The controller's parameters of what is tracked."""
    for kind in ("clip", "keyframes"):
        name = getattr(options, kind)
        if name is not None:
            return {"reference": kind, kind: name}
    plays_network = options.onnx is not None or options.behaviour == "onnx"
    steered = "commanded" if plays_network else "steered"
    reference = options.reference if options.cmd_vel is None else steered
    return {} if reference is None else {"reference": reference}


def _pushes(
    texts: Sequence[str], plan: "RunPlan", found_in: "FoundWith | None"
) -> "list[PlannedPush]":
    """Those of `--push`; without any, those with which a reconstruction was found."""
    from actuated_characters.runs.planned.wrenches import parse_push, parse_pushes_within

    if _NO_PUSH in texts:
        if set(texts) != {_NO_PUSH}:
            raise ConfigurationError(f"--push {_NO_PUSH} goes with no other --push")
        return []
    if texts or found_in is None:
        return [parse_push(text, plan) for text in texts]
    return parse_pushes_within(found_in.pushes, plan)


def _set_option(name: str, value: str | None, controller: dict[str, object]) -> None:
    """Set the parameter of an option. Raises ConfigurationError if `--set` has another value."""
    if value is not None and controller.setdefault(name, value) != value:
        raise ConfigurationError(
            f"--{name} is {value}, and --set controller_node.{name} is {controller[name]}; "
            "give one of them"
        )
