"""The step response of PD control in real time, measured over topics and compared with theory.

A mass of 1 kg on a vertical slider settles at one height, and is then told another. The law is
plain PD without gravity compensation, so that the mass hangs `m g / kp` too low. In two terminals:

    .venv/bin/sim_node --ros-args -p character:=lift -p mode:=realtime -p rate:=500 \
        -p wait_for_subscribers:=1
    .venv/bin/python examples/step_response.py --damping 6 --csv step_response.csv

In real time the world does not wait for an answer. The time from a state to the torque that answers
it, which the theory here neglects, acts like less damping: `kd - kp delay`.
"""

import argparse
import sys

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

MASS, GRAVITY = 1.0, 9.81  # kg, m/s^2
START, STEP = 1.0, 0.5  # m: where the mass begins, and how far the target jumps
SETTLING = 3.0  # s before the step
BEFORE, LENGTH = 0.2, 3.0  # s before and after it that are kept


class StepResponse(Node):
    """Commands PD torques whose target steps; keeps times and heights about the step."""

    def __init__(self, stiffness, damping):
        super().__init__("step_response")
        self.stiffness, self.damping = stiffness, damping
        self.step_time = None  # s, simulated
        self.samples = []  # (time since the step s, height m)
        self.done = Future()
        self.torques = self.create_publisher(JointState, "joint_torques", 10)
        self.create_subscription(JointState, "joint_states", self.on_state, 10)

    def on_state(self, state):
        """Publish the effort for a state."""
        time = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        entry = state.name.index("height")
        height, speed = state.position[entry], state.velocity[entry]
        if self.step_time is None:
            self.step_time = time + SETTLING
        since = time - self.step_time
        target = START if since < 0.0 else START + STEP
        torque = JointState(name=["height"])
        torque.header.stamp = state.header.stamp  # tells the simulator how old the command is
        torque.effort = [self.stiffness * (target - height) - self.damping * speed]
        self.torques.publish(torque)
        if since >= -BEFORE:
            self.samples.append((since, height))
        if since >= LENGTH and not self.done.done():
            self.done.set_result(None)


def theory(times, stiffness, damping):
    """Height (n,) in m after the step: `m x'' + kd x' + kp x = kp x_target - m g`, underdamped."""
    frequency = np.sqrt(stiffness / MASS)  # rad/s, undamped
    ratio = damping / (2.0 * np.sqrt(stiffness * MASS))
    root = np.sqrt(1.0 - ratio**2)
    since = np.maximum(times, 0.0)
    phase = frequency * root * since
    decay = np.exp(-ratio * frequency * since)
    remaining = decay * (np.cos(phase) + ratio / root * np.sin(phase))
    return START - MASS * GRAVITY / stiffness + STEP * (1.0 - remaining)


def measure(times, heights):
    """Rise time s, overshoot % and steady-state error mm of a step response, (n,) each."""
    # before the step, not at it: where the machine is busy the first sample after it comes late
    first, final = heights[times < 0.0].mean(), heights[-len(heights) // 10 :].mean()
    share = (heights - first) / (final - first)
    rise = times[np.argmax(share > 0.9)] - times[np.argmax(share > 0.1)]
    return {
        "rise time (10 % to 90 %), s": rise,
        "overshoot, %": 100.0 * (share.max() - 1.0),
        "steady-state error, mm": 1e3 * (START + STEP - final),
    }


def main():
    """Measure, print the table and write the samples; returns the exit code, 1 if interrupted."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stiffness", type=float, default=100.0, help="N/m")
    parser.add_argument("--damping", type=float, default=6.0, help="N s/m")
    parser.add_argument("--csv", default="step_response.csv", help="file for the samples")
    arguments = parser.parse_args(remove_ros_args()[1:])
    gains = arguments.stiffness, arguments.damping
    ratio = arguments.damping / (2.0 * np.sqrt(arguments.stiffness * MASS))
    if not 0.0 < ratio < 1.0:
        parser.error(f"the damping ratio is {ratio:.2f}; it must be between 0 and 1")

    rclpy.init()
    try:
        node = StepResponse(*gains)
        while rclpy.ok() and not node.done.done():  # a wait without end may miss a SIGTERM
            rclpy.spin_until_future_complete(node, node.done, timeout_sec=0.5)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 1
    except RuntimeError:  # rcl's own, where a signal comes just before a wait
        if rclpy.ok():
            raise
        return 1
    finally:
        rclpy.try_shutdown()
    if not node.done.done():  # a signal other than Ctrl-C has ended it
        return 1

    times, heights = np.array(node.samples).T
    expected = theory(times, *gains)
    print(f"kp {gains[0]:g} N/m, kd {gains[1]:g} N s/m, damping ratio {ratio:.2f}")
    print(f"{'':30}{'measured':>10}{'theory':>10}")
    in_theory = measure(times, expected)
    for name, value in measure(times, heights).items():
        print(f"{name:30}{value:10.3f}{in_theory[name]:10.3f}")
    samples = np.column_stack((times, heights, expected))
    header = "time_s,height_m,theory_m"
    np.savetxt(arguments.csv, samples, delimiter=",", header=header, comments="", fmt="%.6f")
    return 0


sys.exit(main())
