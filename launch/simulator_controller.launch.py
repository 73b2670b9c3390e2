"""Simulator and controller: a character that is moved by torques."""

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = "actuated_characters"
SHARE = FindPackageShare(PACKAGE)
CONFIG = PathJoinSubstitution([SHARE, "config", LaunchConfiguration("config")])
SIMULATOR = PathJoinSubstitution([SHARE, "launch", "simulator.launch.py"])
OVERRIDES = ("character", "reference", "clip", "wait_for_subscribers")
"""Parameters that arguments of the same names set, instead of the config."""


def generate_launch_description() -> LaunchDescription:
    """The simulator with its arguments, which are the controller's too, and the controller's."""
    return LaunchDescription(
        [
            IncludeLaunchDescription(PythonLaunchDescriptionSource(SIMULATOR)),
            DeclareLaunchArgument(
                "reference",
                default_value="",
                description="what to track: hold or clip; empty: as in the config",
            ),
            DeclareLaunchArgument(
                "clip",
                default_value="",
                description="name of a clip of the character, or path; empty: the config's",
            ),
            OpaqueFunction(function=_start),
        ]
    )


def _start(context: LaunchContext) -> list[Node]:
    arguments = {name: LaunchConfiguration(name) for name in OVERRIDES}
    return [
        Node(
            package=PACKAGE,
            executable="controller_node",
            name="controller_node",
            namespace=LaunchConfiguration("namespace"),
            # not among `parameters`, where a file that does not exist is no error
            ros_arguments=["--params-file", CONFIG],
            parameters=[{name: it for name, it in arguments.items() if it.perform(context)}],
            output="screen",
            on_exit=Shutdown(reason="the controller has ended"),
        )
    ]
