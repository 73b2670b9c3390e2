"""Simulator and controller: a character that is moved by torques."""

from launch import LaunchDescription

from actuated_characters import launching


def generate_launch_description() -> LaunchDescription:
    """The simulator with its arguments, which are the controller's too, and the controller's."""
    return LaunchDescription(
        [
            launching.include("simulator.launch.py"),
            *launching.declare_parameters("reference", "clip"),
            launching.start(
                "controller_node", "character", "reference", "clip", "wait_for_subscribers"
            ),
        ]
    )
