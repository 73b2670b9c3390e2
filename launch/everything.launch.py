"""Simulator, controller and recorder: a run that leaves a bag and figures."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "actuated_characters"
SIMULATOR_CONTROLLER = PathJoinSubstitution(
    [FindPackageShare(PACKAGE), "launch", "simulator_controller.launch.py"]
)


def generate_launch_description() -> LaunchDescription:
    """Simulator and controller with their arguments, and the recorder."""
    return LaunchDescription(
        [
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(SIMULATOR_CONTROLLER),
                # each other and the recorder, so that not even the first tick goes unrecorded
                launch_arguments={"wait_for_subscribers": "2"}.items(),
            ),
            DeclareLaunchArgument(
                "directory",
                default_value="recording",
                description="where bag, summary.json and measurements.csv go",
            ),
            Node(
                package=PACKAGE,
                executable="recorder",
                name="recorder",
                namespace=LaunchConfiguration("namespace"),
                # a text, also where it looks like a number
                parameters=[
                    {"directory": ParameterValue(LaunchConfiguration("directory"), value_type=str)}
                ],
                output="screen",
                on_exit=Shutdown(reason="the recorder has ended"),
            ),
        ]
    )
