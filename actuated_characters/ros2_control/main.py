"""The executable `ros2_control_bridge`."""

from typing import NoReturn

from msgs_config.runtime.process import run_node

_ABOUT = """\
Stands between sim_node and a controller manager of ros2_control, in lockstep with both: publishes
robot_joint_states and /clock, and answers each state by what comes on robot_joint_commands.
Start sim_node with -r /clock:=sim_clock, for a controller manager must wait for this node's clock.

"""


def main() -> NoReturn:
    """Run the bridge until a signal."""
    run_node("actuated_characters.ros2_control.node:BridgeNode", _ABOUT)


if __name__ == "__main__":
    main()
