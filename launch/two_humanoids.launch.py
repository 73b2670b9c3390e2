"""One simulator of two characters, and a controller in the namespace of each."""

from launch import LaunchDescription

from actuated_characters import launching

CHARACTERS = ("left", "right")
"""As the config's parameter `characters` names them."""


def generate_launch_description() -> LaunchDescription:
    """The three nodes, and their arguments."""
    return LaunchDescription(
        [
            launching.declare_config("two_humanoids.yaml"),
            *launching.declare_parameters("max_ticks"),
            launching.start("sim_node", "max_ticks", namespace=""),
            *(launching.start("controller_node", namespace=name) for name in CHARACTERS),
        ]
    )
