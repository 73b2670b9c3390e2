"""A recorded run whose parameters were changed at its resets."""

from pathlib import Path
from typing import NamedTuple

from geometry_msgs.msg import Twist, TwistStamped, Vector3
from rclpy.context import Context
from std_msgs.msg import String

from msgs_config.messages import topics
from tests.support.physics import character
from tests.support.recorded_nodes import recorded
from tests.support.ros import SimulatorClient, stamp_ns, tick_of

BEGINS = (0, 31, 72, 113, 150)
"""The rows of the first states of the episodes."""
TICKS = 200
MOON = 1.62  # m/s^2
KEYFRAMES = {"keyframe_period": 0.3}
"""The parameter of both nodes: a keyframe is of the row 144; in row 72 an episode begins."""
SIMULATOR, CONTROLLER = topics.SIM_NODE, topics.CONTROLLER_NODE


class ChangedEpisodes(NamedTuple):
    """The run, and what its nodes have published."""

    run: Path
    configurations: list[String]  # of the simulator
    velocities_ns: list[int]  # the stamps of the active ones


def record_changed_episodes(folder: Path, context: Context) -> ChangedEpisodes:
    """A walk; a run on the moon; a limp fall there; a reactive walk; a steered one."""
    client = SimulatorClient(context)
    velocities = client.speak(topics.CMD_VEL_STAMPED)
    active = client.listen(topics.ACTIVE_CMD_VEL.of(CONTROLLER))

    def step(count: int) -> None:
        change(SIMULATOR, step_count=count)
        steps = client.step()
        client.spin_until(steps.done, f"{count} steps")
        assert steps.result().success, steps.result().message

    def change(node: str, **values: object) -> None:
        for name, value in values.items():
            assert client.set_parameter(node, name, value) == (True, ""), name

    def steer(speed: float) -> None:
        velocities.publish(TwistStamped(twist=Twist(linear=Vector3(x=speed))))
        assert velocities.wait_for_all_acked()

    with recorded(folder / "changed") as processes:
        simulator = processes.simulator(
            "humanoid",
            commanded_joints=["root", *character("humanoid").layout.actuated_joint_names],
            initial_state="reference",
            max_ticks=TICKS,
            wait_for_subscribers=4,
            **KEYFRAMES,
        )
        processes.controller("humanoid", reference="clip", wait_for_subscribers=2, **KEYFRAMES)
        assert client.pause(True).success
        client.listen(topics.JOINT_STATES)  # is the fourth, without whom nothing begins
        client.spin_until(lambda: client.states.messages, "the first state")
        step(BEGINS[1] - 1)
        answers = client.listen(topics.JOINT_TORQUES)
        change(SIMULATOR, gravity=MOON, friction=0.4)
        change(CONTROLLER, gravity=MOON, clip="run")
        assert client.reset().success
        step(BEGINS[2] - BEGINS[1] - 1)
        change(CONTROLLER, behaviour="ragdoll")
        assert client.reset().success
        step(BEGINS[3] - BEGINS[2] - 1)
        change(SIMULATOR, gravity=9.81, link_friction=0.6, solver_iterations=20)
        change(CONTROLLER, behaviour="reactive", library=["walk"], gravity=9.81, clip="walk")
        assert client.reset().success
        step(BEGINS[4] - BEGINS[3] - 1)
        change(CONTROLLER, behaviour="tracking", reference="steered")
        client.spin_until(lambda: velocities.get_subscription_count() == 2, "who hears velocities")
        steer(0.8)  # counts from the first state of the episode on
        assert client.reset().success
        step(3)
        answered = BEGINS[4] + 3 + 1  # row 0 is the state of tick 1
        client.spin_until(lambda: answers and tick_of(answers.last) == answered, "its answer")
        steer(1.0)  # from the next state on
        assert client.pause(False).success
        assert simulator.wait() == 0
    client.spin_until(lambda: len(active.messages) >= 2, "both active velocities")
    velocities_ns = [stamp_ns(message) for message in active.messages]
    configurations = list(client.configuration.messages)
    client.close()
    return ChangedEpisodes(folder / "changed" / "run", configurations, velocities_ns)
