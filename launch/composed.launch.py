"""Simulator and controllers in one process and one thread; without an end, as fast as they can."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = "actuated_characters"
CONFIG = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", LaunchConfiguration("config")])
OVERRIDES = ("character", "wait_for_subscribers")
"""Parameters of all nodes that arguments of the same names set, instead of the config."""


def generate_launch_description() -> LaunchDescription:
    """The process and its arguments."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "config",
                default_value="humanoid_walk.yaml",
                description="parameter file: the name of one that ships, or an absolute path",
            ),
            DeclareLaunchArgument(
                "character",
                default_value="",
                description="name of a character, or path of its .yaml file; empty: the config's",
            ),
            DeclareLaunchArgument(
                "wait_for_subscribers",
                default_value="",
                description="begin when so many listen to a node; empty: as in the config",
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="namespace of nodes and topics"
            ),
            OpaqueFunction(function=_start),
        ]
    )


def _start(context: LaunchContext) -> list[Node]:
    arguments = {name: LaunchConfiguration(name) for name in OVERRIDES}
    return [
        Node(
            package=PACKAGE,
            executable="composed",
            # without a name, which all its nodes would have
            namespace=LaunchConfiguration("namespace"),
            # not among `parameters`, where a file that does not exist is no error
            ros_arguments=["--params-file", CONFIG],
            parameters=[{name: it for name, it in arguments.items() if it.perform(context)}],
            output="screen",
            on_exit=Shutdown(reason="simulator or controller has ended"),
        )
    ]
