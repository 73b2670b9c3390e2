"""Plays the controller manager's side of ros2_control, in a process of its own, by its ways.

They are those of ros2_control 4 (Jazzy) and of joint_state_topic_hardware_interface 1.1, as their
sources have them: the robot's description comes on its topic, and says joints and topics; the loop
has a thread of its own, sleeps by the clock, and begins with whatever the clock says; states come
on an executor's thread, best effort, of which a read takes the last one; the node of the hardware
has a clock of its own, and its stamps are that clock's; before a controller is active commands are
NaN, and each update writes one. The controller here, which becomes active at a time of the wall,
follows a motion by feedback with an integral, so that one state taken too late alters all the rest.

    python -m tests.support.played_manager UPDATE_RATE MOTION_START ACTIVE_AFTER
"""

import itertools
import math
import os
import sys
import threading
import time
from array import array
from xml.etree import ElementTree

from msgs_config.runtime.process import StopSignal, middleware_settings

SWING, ANGULAR_RATE, FEEDBACK, INTEGRAL = 0.3, 3.0, 0.2, 0.5  # rad, rad/s, 1, 1/s


def main() -> None:
    rate, start, active_after = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    os.environ.update(middleware_settings(os.environ))
    stop = StopSignal()
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(
        args=["--ros-args", "-p", "use_sim_time:=true"],
        signal_handler_options=SignalHandlerOptions.NO,
    )
    threading.Thread(target=_end_by, args=(stop,), daemon=True).start()
    Manager(rate, start, active_after).run(stop)
    os._exit(0)


def _end_by(stop: StopSignal) -> None:
    """End the process at a signal, whatever it waits for."""
    while not stop:
        time.sleep(0.02)
    os._exit(0)


class Manager:
    def __init__(self, rate: int, start: float, active_after: float) -> None:
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
        from sensor_msgs.msg import JointState
        from std_msgs.msg import String

        self._type, self._rate, self._start_ns = JointState, rate, round(start * 1e9)
        self._active_at = time.monotonic() + active_after
        self.node = Node("controller_manager")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._description: list[str] = []
        self.node.create_subscription(
            String, "robot_description", lambda m: self._description.append(m.data), latched
        )
        executor = SingleThreadedExecutor()
        executor.add_node(self.node)
        threading.Thread(target=executor.spin, daemon=True).start()
        while not self._description:
            time.sleep(0.01)
        (tag,) = ElementTree.fromstring(self._description[0]).iter("ros2_control")
        parameters = {each.get("name"): each.text for each in tag.iter("param")}
        assert tag.findtext("hardware/plugin") == (
            "joint_state_topic_hardware_interface/JointStateTopicSystem"
        )
        self._threshold = float(str(parameters["trigger_joint_command_threshold"]))
        self._joints = [str(each.get("name")) for each in tag.iter("joint")]
        self._kinds = [
            str(each.get("name")) for each in next(tag.iter("joint")).iter("command_interface")
        ]
        self._latest = JointState()
        self.hardware = Node(str(tag.get("name")).lower())
        self.hardware.create_subscription(
            JointState, str(parameters["joint_states_topic"]), self._keep, qos_profile_sensor_data
        )
        self._commands = self.hardware.create_publisher(
            JointState, str(parameters["joint_commands_topic"]), QoSProfile(depth=1)
        )
        of_hardware = SingleThreadedExecutor()
        of_hardware.add_node(self.hardware)
        threading.Thread(target=of_hardware.spin, daemon=True).start()
        self._state: dict[str, float] = dict.fromkeys(self._joints, math.nan)
        self._home: dict[str, float] | None = None
        self._sums = dict.fromkeys(self._joints, 0.0)
        self._command = dict.fromkeys(self._joints, math.nan)

    def _keep(self, message: object) -> None:
        self._latest = message

    def _now(self) -> int:
        return int(self.node.get_clock().now().nanoseconds)

    def _sleep_until(self, when_ns: int, stop: StopSignal) -> None:
        while self._now() < when_ns and not stop:
            time.sleep(2e-5)

    def run(self, stop: StopSignal) -> None:
        """As `ros2_control_node`: waits for the clock, then updates whenever a period is over."""
        period = 10**9 // self._rate
        self._sleep_until(1, stop)
        self._sleep_until(self._now() + period, stop)
        time.sleep(period / 1e9)
        for _ in itertools.count():
            if stop:
                return
            previous = self._now()
            self._read()
            self._update(previous)
            self._write()
            self._sleep_until(previous + period, stop)

    def _read(self) -> None:
        latest = self._latest
        for name, position in zip(latest.name, latest.position, strict=True):
            self._state[name] = position

    def _update(self, now_ns: int) -> None:
        if time.monotonic() < self._active_at or math.isnan(self._state[self._joints[0]]):
            return
        if self._home is None:
            self._home = dict(self._state)
        seconds = max(now_ns - self._start_ns, 0) / 1e9
        for number, name in enumerate(self._joints):
            swing = 0.01 if "finger" in name else SWING
            wanted = self._home[name] + swing * (1.0 - math.cos(ANGULAR_RATE * seconds)) * (
                -1.0 if number % 2 else 1.0
            )
            error = wanted - self._state[name]
            if now_ns >= self._start_ns:
                self._sums[name] += error / self._rate
            self._command[name] = wanted + FEEDBACK * error + INTEGRAL * self._sums[name]

    def _write(self) -> None:
        difference = sum(abs(self._state[n] - self._command[n]) for n in self._joints)
        if difference <= self._threshold:
            return
        message = self._type(name=self._joints)
        message.header.stamp = self.hardware.get_clock().now().to_msg()
        commands = array("d", (self._command[name] for name in self._joints))
        unclaimed = array("d", itertools.repeat(math.nan, len(self._joints)))
        for kind in self._kinds:
            setattr(message, kind, commands if kind == "position" else unclaimed)
        self._commands.publish(message)


if __name__ == "__main__":
    main()
