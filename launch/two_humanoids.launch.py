"""One simulator of two characters, and a controller in the namespace of each."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = "actuated_characters"
CONFIG = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", LaunchConfiguration("config")])
CHARACTERS = ("left", "right")
"""As the config's parameter `characters` names them."""


def generate_launch_description() -> LaunchDescription:
    """The three nodes, and their arguments."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "config",
                default_value="two_humanoids.yaml",
                description="parameter file: the name of one that ships, or an absolute path",
            ),
            DeclareLaunchArgument(
                "max_ticks",
                default_value="",
                description="end after so many ticks; empty: as in the config, 0: never",
            ),
            OpaqueFunction(function=_start),
        ]
    )


def _start(context: LaunchContext) -> list[Node]:
    ticks = LaunchConfiguration("max_ticks")
    return [
        Node(
            package=PACKAGE,
            executable="sim_node",
            name="sim_node",
            # not among `parameters`, where a file that does not exist is no error
            ros_arguments=["--params-file", CONFIG],
            parameters=[{"max_ticks": ticks}] if ticks.perform(context) else [],
            output="screen",
            on_exit=Shutdown(reason="the simulator has ended"),
        ),
        *(
            Node(
                package=PACKAGE,
                executable="controller_node",
                name="controller_node",
                namespace=character,
                ros_arguments=["--params-file", CONFIG],
                output="screen",
                on_exit=Shutdown(reason="a controller has ended"),
            )
            for character in CHARACTERS
        ),
    ]
