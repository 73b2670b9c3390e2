"""Balances the humanoid from what a real robot has: an IMU, force sensors under its feet, encoders.

In two terminals, in any order, and a push in a third:

    .venv/bin/sim_node --ros-args -p character:=humanoid -p rate:=1000
    .venv/bin/python examples/balance.py
    .venv/bin/python examples/push.py --link chest --force 50 0 0

The floating base's position and velocity are on `joint_states`, too, and are not used. PD control
of the joints (encoders) holds the body straight. It stands on its ankles like an inverted pendulum:
their torque draws the lean of the pelvis (IMU) to a target, in shares of the load on each foot, no
more than the soles bear. At rest the centre of pressure (force sensors) is below the centre of
mass, so the target slowly moves until that is in the middle of the soles. It bears pushes of 7 N s.

This is explicit PD, which is why the rate is 1000 Hz; see `two_controllers.py`.
"""

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

# stiffness N m/rad and damping N m s/rad, by a part of the entry's name; the first counts
GAINS = {
    "hip_y": (300.0, 5.0),  # about the leg, which has little inertia
    "hip": (1000.0, 20.0),
    "knee": (800.0, 20.0),
    "ankle": (20.0, 0.3),
    "chest": (1000.0, 30.0),
    "neck": (100.0, 3.0),
    "shoulder": (60.0, 1.0),
    "elbow": (60.0, 1.0),
}
PITCH_GAINS = 700.0, 120.0  # N m/rad, N m s/rad: of the lean forward, both ankles together
ROLL_GAINS = 210.0, 36.0  # sideways, where two legs stand by themselves
HEEL_TORQUE, TOE_TORQUE = 17.0, 53.0  # N m: the weight times how far the edges are from the ankles
EDGE_TORQUE = 15.0  # N m, sideways
CENTRING = 0.3  # rad/(m s), how fast the target follows the centre of pressure
MOST_LEAN = 0.15  # rad, of the target
LEAST_LOAD = 50.0  # N on both feet; with less it does not stand
SENSORS = {
    "imu/pelvis_imu": Imu,
    "force/left_sole": WrenchStamped,
    "force/right_sole": WrenchStamped,
}


def gains_of(entry):
    """Stiffness and damping of an entry of `joint_states`; none of the base's."""
    return next((pair for part, pair in GAINS.items() if part in entry), (0.0, 0.0))


class BalanceController(Node):
    """Answers each state once, when the readings of its stamp are there."""

    def __init__(self):
        super().__init__("balance_controller")
        self.latest = {}  # by topic
        self.command = None  # to the last state, for when it comes again
        self.names = None  # of the entries with encoders
        self.target = 0.0  # of the lean forward, rad
        self.time = None  # of the last answered state, s
        self.torques = self.create_publisher(JointState, "joint_torques", 10)
        for topic, kind in {**SENSORS, "joint_states": JointState}.items():
            self.create_subscription(
                kind, topic, lambda m, name=topic: self.on_message(name, m), 10
            )

    def on_message(self, topic, message):
        """Answer a state if this is the last of its messages."""
        self.latest[topic] = message
        stamp = message.header.stamp
        if len(self.latest) <= len(SENSORS):
            return
        if any(each.header.stamp != stamp for each in self.latest.values()):
            return  # the others are still to come
        if self.command is None or self.command.header.stamp != stamp:
            effort = self.compute(stamp.sec + 1e-9 * stamp.nanosec)
            self.command = JointState(name=self.names, effort=effort.tolist())
            self.command.header.stamp = stamp
        elif topic != "joint_states":
            return
        self.torques.publish(self.command)

    def compute(self, time):
        """The effort of each joint, from the readings of one time in s."""
        imu, left, right, encoders = (self.latest[name] for name in (*SENSORS, "joint_states"))
        if self.names is None:
            self.names = [name for name in encoders.name if not name.startswith("root_")]
            self.gains = np.array([gains_of(name) for name in self.names]).T
        motions = np.transpose((encoders.position, encoders.velocity))
        measured = dict(zip(encoders.name, motions, strict=True))
        position, velocity = np.array([measured[name] for name in self.names]).T
        # towards zero: a rotation vector's way there is the straight one
        effort = -self.gains[0] * position - self.gains[1] * velocity

        passed = 0.0 if self.time is None else time - self.time
        self.time = time
        pitch_torque, roll_torque = self.balance(imu, left.wrench, right.wrench, passed)
        loads = np.maximum([left.wrench.force.z, right.wrench.force.z], 0.0)
        shares = loads / loads.sum() if loads.sum() > LEAST_LOAD else np.array((0.5, 0.5))
        for side, share in zip(("left", "right"), shares, strict=True):
            # a torque on the body is the opposite of one on the foot, whose z points to the right
            effort[self.names.index(f"{side}_ankle_z")] += share * pitch_torque
            effort[self.names.index(f"{side}_ankle_x")] -= share * roll_torque
        return effort

    def balance(self, imu, left, right, passed):
        """Torques on the body about y (left) and x (forward), N m; `passed` s since the last."""
        x, y, z, w = (getattr(imu.orientation, axis) for axis in "xyzw")
        # where the pelvis' z axis leans to, seen from the pelvis, whichever way that looks
        forward, sideways = 2.0 * (w * y - x * z), -2.0 * (w * x + y * z)
        load = left.force.z + right.force.z
        if load > LEAST_LOAD:
            pressure = -(left.torque.y + right.torque.y) / load  # m in front of the soles' middle
            self.target -= CENTRING * passed * pressure
            self.target = min(max(self.target, -MOST_LEAN), MOST_LEAN)
        rates = imu.angular_velocity
        pitch = PITCH_GAINS[0] * (self.target - forward) - PITCH_GAINS[1] * rates.y
        roll = ROLL_GAINS[0] * sideways - ROLL_GAINS[1] * rates.x
        return (
            min(max(pitch, -TOE_TORQUE), HEEL_TORQUE),
            min(max(roll, -EDGE_TORQUE), EDGE_TORQUE),
        )


rclpy.init()
try:
    node = BalanceController()
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0.5)  # rclpy.spin may sleep through a SIGTERM
except (KeyboardInterrupt, ExternalShutdownException):
    pass
except RuntimeError:  # rcl's own, where a signal comes just before a wait
    if rclpy.ok():
        raise
finally:
    rclpy.try_shutdown()
