"""Options of the command `run`, by what they are about."""

import argparse

from actuated_characters.commands.common.parameter_choices import ParameterChoices, add_choice
from actuated_characters.commands.view import add_server

ALL_SENSORS = "all"
_SIMULATOR, _CONTROLLER = "sim_node.parameters", "controller_node.parameters"
_RECORDER = "actuated_characters.recorder.parameters"


def add_tracked(run: argparse.ArgumentParser) -> None:
    """Add the options that say what is tracked, and how."""
    tracked = run.add_mutually_exclusive_group()
    tracked.add_argument(
        "--clip",
        help="track this motion clip: a name or a file. One by `motion reconstruct` brings the "
        "length, the parameters and the pushes that it was found with; --duration, --set and "
        "--push take precedence",
    )
    tracked.add_argument(
        "--keyframes", help="track these keyframes: a shipped name or a .yaml file"
    )
    tracked.add_argument(
        "--timeline",
        metavar="FILE",
        help="do what this timeline says, a shipped name or a .yaml file: poses, clips and "
        "steering in time, pushes, balls, pins and strengths; --character, --duration, --set and "
        "other options take precedence",
    )
    add_choice(
        tracked,
        "--reference",
        ParameterChoices(_CONTROLLER, "reference", without=("clip", "keyframes", "timeline")),
        help="the rest pose (hold, the default), a test signal from it, or a walk steered by the "
        "topic cmd_vel",
    )
    tracked.add_argument(
        "--cmd-vel",
        metavar="'X,Y,TURN@S ...'",
        help="steer: m/s ahead and to the left, rad/s to the left, each from a time in s on; "
        "backward at first: --cmd-vel='-0.4,0,0@1 ...'",
    )
    add_choice(
        run,
        "--behaviour",
        ParameterChoices(_CONTROLLER, "behaviour"),
        help="track whatever comes (tracking, the default); be limp; go limp on a hard hit, and "
        "get up; react to hits; go through the states of a machine; or play a network",
    )
    run.add_argument(
        "--machine",
        metavar="NAME",
        help="walk, or what else a state machine does by joint torques alone, steered by cmd_vel: "
        "a shipped one, such as walk, or a .yaml file (--behaviour state_machine)",
    )
    run.add_argument(
        "--onnx",
        metavar="FILE",
        help="play a policy of another trainer (--behaviour onnx); what its metadata lack is said "
        "in FILE.yaml for FILE.onnx: docs/policies.md",
    )
    add_choice(
        run,
        "--collision",
        ParameterChoices(_SIMULATOR, "collision"),
        help="what the character collides with: as its file has it (file, the default), or nothing "
        "(none), in which case meshes may be missing",
    )
    add_choice(
        run,
        "--planner",
        ParameterChoices(_CONTROLLER, "planner", without=("recorded",)),
        help="keep the motion by joint torques alone, without root assistance: planned ahead "
        "(predictive), by the policy that controller_node.policy says (policy), or not (none, the "
        "default)",
    )


def add_viewed(run: argparse.ArgumentParser) -> None:
    """Add the options of the viewer."""
    run.add_argument(
        "--view",
        action="store_true",
        help="show the run in a browser, in real time unless sim_node.real_time_factor is set "
        "(needs the extra 'view'); where, is printed",
    )
    add_server(run)


def add_recorded(run: argparse.ArgumentParser) -> None:
    """Add the options that say what is recorded, and how."""
    run.add_argument("--no-record", action="store_true", help="write no bag")
    add_choice(
        run,
        "--compression",
        ParameterChoices(_RECORDER, "compression"),
        help="how the bag is compressed (none)",
    )
    add_choice(
        run,
        "--log-time",
        ParameterChoices(_RECORDER, "log_time"),
        help="clock of the bag's log times (wall); with simulated, players show 20 s as 20 s",
    )
    for name, about in (
        ("--topic", "record this topic beside those of the simulation"),
        (
            "--sensor",
            f"record this sensor of the character, such as imu/NAME, or {ALL_SENSORS} of them",
        ),
        ("--exclude", "do not record this topic of the simulation, such as contacts"),
    ):
        run.add_argument(name, action="append", metavar="NAME", help=f"{about}; may be repeated")


def add_loop(run: argparse.ArgumentParser) -> None:
    """Add the options that say in which processes the loop runs."""
    loop = run.add_mutually_exclusive_group()
    loop.add_argument(
        "--composed",
        action="store_true",
        help="simulator and controller as two nodes of one process: the same states, sooner",
    )
    loop.add_argument(
        "--in-process",
        action="store_true",
        help="all nodes in this process, without ROS: the same messages and bag, sooner",
    )
