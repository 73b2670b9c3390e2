"""The simulator alone; any node that answers its states moves the character."""

from launch import LaunchDescription

from actuated_characters import launching

PARAMETERS = ("character", "initial_state", "max_ticks", "wait_for_subscribers")


def generate_launch_description() -> LaunchDescription:
    """The node and its arguments."""
    return LaunchDescription(
        [
            launching.declare_config(),
            launching.declare_namespace(),
            *launching.declare_parameters(*PARAMETERS),
            launching.start("sim_node", *PARAMETERS),
        ]
    )
