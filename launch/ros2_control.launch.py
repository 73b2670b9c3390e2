"""The Panda under ros2_control: simulator, bridge, a stock controller manager, its controllers."""

from launch import LaunchDescription

from actuated_characters import launching

PARAMETERS = ("character", "max_ticks", "wait_for_subscribers")
CONTROLLERS = ("joint_state_broadcaster", "joint_trajectory_controller")


def generate_launch_description() -> LaunchDescription:
    """The nodes in lockstep, whose clock is the bridge's, and spawners of the controllers."""
    return LaunchDescription(
        [
            launching.declare_config("franka_panda_ros2_control.yaml"),
            launching.declare_namespace(),
            *launching.declare_parameters(*PARAMETERS),
            launching.start("sim_node", *PARAMETERS, remappings=(("/clock", "sim_clock"),)),
            launching.start("ros2_control_bridge", "character"),
            launching.start_controller_manager(),
            *(launching.start_spawner(name) for name in CONTROLLERS),
        ]
    )
