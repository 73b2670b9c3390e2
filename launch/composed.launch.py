"""Simulator and controllers in one process and one thread; without an end, as fast as they can."""

from launch import LaunchDescription

from actuated_characters import launching

PARAMETERS = ("character", "wait_for_subscribers")


def generate_launch_description() -> LaunchDescription:
    """The process and its arguments, whose parameters are of all its nodes."""
    return LaunchDescription(
        [
            launching.declare_config(),
            launching.declare_namespace(),
            *launching.declare_parameters(*PARAMETERS),
            launching.start("composed", *PARAMETERS),
        ]
    )
