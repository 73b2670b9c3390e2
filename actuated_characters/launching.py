"""What the launch files share: nodes of this package, and the arguments that set parameters."""

from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch.launch_context import LaunchContext
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "actuated_characters"
SHARE = FindPackageShare(PACKAGE)
CONFIG = PathJoinSubstitution([SHARE, "config", LaunchConfiguration("config")])
PARAMETERS = {
    "character": "name of a character, or path of its .yaml file; empty: the config's",
    "clip": "name of a clip of the character, or path; empty: the config's",
    "initial_state": "given, without controller_node, or reference; empty: the config's",
    "max_ticks": "end after this many ticks; 0: never; empty: as in the config",
    "reference": "what to track: hold or clip; empty: as in the config",
    "wait_for_subscribers": "begin when so many listen to a node; empty: as in the config",
}
"""Arguments that set parameters of the same names, instead of the config."""


def declare_config(default: str = "humanoid_walk.yaml") -> DeclareLaunchArgument:
    """The argument that names the nodes' parameter file."""
    about = "parameter file: the name of one that ships, or an absolute path"
    return DeclareLaunchArgument("config", default_value=default, description=about)


def declare_namespace() -> DeclareLaunchArgument:
    """The argument that names where the nodes and topics stand."""
    about = "namespace of nodes and topics"
    return DeclareLaunchArgument("namespace", default_value="", description=about)


def declare_parameters(*names: str) -> list[DeclareLaunchArgument]:
    """Arguments of `PARAMETERS`."""
    return [
        DeclareLaunchArgument(name, default_value="", description=PARAMETERS[name])
        for name in names
    ]


def include(file: str, **arguments: str) -> IncludeLaunchDescription:
    """What another launch file of this package starts, with its arguments and those given."""
    source = PythonLaunchDescriptionSource(PathJoinSubstitution([SHARE, "launch", file]))
    return IncludeLaunchDescription(source, launch_arguments=arguments.items())


def start(
    executable: str,
    *parameters: str,
    namespace: str | None = None,
    remappings: tuple[tuple[str, str], ...] = (),
) -> OpaqueFunction:
    """A node of this package, with the config, and the parameters whose arguments are not empty.

    It is in the namespace of the argument, or in the one given; its end is that of all.
    """

    def node(context: LaunchContext) -> list[Node]:
        given = {name: LaunchConfiguration(name) for name in parameters}
        return [
            Node(
                package=PACKAGE,
                executable=executable,
                # a process of several nodes has no name, which all of them would have
                name=None if executable == "composed" else executable,
                namespace=LaunchConfiguration("namespace") if namespace is None else namespace,
                # not among `parameters`, where a file that does not exist is no error
                ros_arguments=["--params-file", CONFIG],
                parameters=[{name: it for name, it in given.items() if it.perform(context)}],
                remappings=list(remappings),
                output="screen",
                on_exit=Shutdown(reason=f"{executable} has ended"),
            )
        ]

    return OpaqueFunction(function=node)


def start_controller_manager() -> Node:
    """A controller manager of ros2_control, with the config; its end is that of all.

    Without a name of its own its parameters are those of all nodes in its process: the one for the
    hardware and each controller must take the simulated time as well.
    """
    return Node(
        package="controller_manager",
        executable="ros2_control_node",
        namespace=LaunchConfiguration("namespace"),
        ros_arguments=["--params-file", CONFIG],
        parameters=[{"use_sim_time": True}],
        output="screen",
        on_exit=Shutdown(reason="ros2_control_node has ended"),
    )


def start_spawner(controller: str) -> Node:
    """What loads a controller and makes it active, and ends then."""
    return Node(
        package="controller_manager",
        executable="spawner",
        namespace=LaunchConfiguration("namespace"),
        arguments=[controller, "--controller-manager-timeout", "60"],
        output="screen",
    )


def start_recorder() -> Node:
    """The recorder, which has no config, but the argument `directory`."""
    # A text, if it looks like a number as well.
    directory = ParameterValue(LaunchConfiguration("directory"), value_type=str)
    return Node(
        package=PACKAGE,
        executable="recorder",
        name="recorder",
        namespace=LaunchConfiguration("namespace"),
        parameters=[{"directory": directory}],
        output="screen",
        on_exit=Shutdown(reason="recorder has ended"),
    )
