"""Simulator, controller and recorder: a run that leaves a bag and figures."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument

from actuated_characters import launching


def generate_launch_description() -> LaunchDescription:
    """Simulator and controller with their arguments, and the recorder."""
    return LaunchDescription(
        [
            # each other and the recorder, so that not even the first tick goes unrecorded
            launching.include("simulator_controller.launch.py", wait_for_subscribers="2"),
            DeclareLaunchArgument(
                "directory",
                default_value="recording",
                description="where bag, summary.json and measurements.csv go",
            ),
            launching.start_recorder(),
        ]
    )
