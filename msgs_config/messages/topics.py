"""The table of topics: all that is known of each, once.

What is recorded, measured, read, played again and documented is taken from here.
"""

import re
from dataclasses import replace

from msgs_config.character.sensors import SensorType
from msgs_config.messages.topic import (
    CHANGES,
    DISPLAY,
    LATCHED,
    STREAM,
    Kept,
    SessionPlace,
    Topic,
)

SIM_NODE = "sim_node"
CONTROLLER_NODE = "controller_node"
RECORDER_NODE = "recorder"
VIEWER_NODE = "viewer"
BRIDGE_NODE = "ros2_control_bridge"

JOINT_STATES = Topic(
    "joint_states",
    "sensor_msgs/msg/JointState",
    STREAM,
    "sim_node → all",
    kept=Kept.ALWAYS,
    session=SessionPlace.FRAME_ID,
    is_measured=True,
    is_of_tick=True,
    content=(
        "state at tick k, stamped with its simulated time; `effort` = the commanded torque "
        "that was really applied during the previous tick (after clipping); **empty in the "
        "first state of an episode**"
    ),
)
JOINT_TORQUES = Topic(
    "joint_torques",
    "sensor_msgs/msg/JointState",
    STREAM,
    "a controller → sim_node",
    kept=Kept.ALWAYS,
    session=SessionPlace.FRAME_ID_IF_ANY,
    is_measured=True,
    content="`name` + `effort`; `header.stamp` **repeats the stamp of the answered state**",
)
EXTERNAL_WRENCH = Topic(
    "external_wrench",
    "sensor_msgs/msg/MultiDOFJointState",
    STREAM,
    "any node → sim_node",
    session=SessionPlace.FRAME_ID_IF_ANY,
    content=(
        "pushes: `joint_names` = links, `wrench` in world axes, translations of "
        "`transforms` (optional) = points of application in the link frames, else the "
        "links' centres of mass; the simulator holds a push for `wrench_duration`"
    ),
)
PIN = Topic(
    "pin",
    "sensor_msgs/msg/MultiDOFJointState",
    STREAM,
    "any node → sim_node",
    session=SessionPlace.FRAME_ID_IF_ANY,
    content=(
        "points of links to hold to places in the world: `joint_names` = links, translations of "
        "`transforms` = the places (m, world), linear parts of `twist` (optional) = the points (m, "
        "link frames; no velocities), else the links' origins, `force.x` of `wrench` = the largest "
        "force (N), 0 lets go. They hold from the stamp on, with stamp 0 from the next tick on, "
        "until the next message for the link or the episode's end. A spring yields by 2 cm at the "
        "largest force, and slips beyond it"
    ),
)
APPLIED_PIN = Topic(
    "applied_pin",
    "sensor_msgs/msg/MultiDOFJointState",
    STREAM,
    "sim_node → all",
    session=SessionPlace.FRAME_ID,
    content=(
        "the pins that were in force during the previous tick, as in `pin`, in the links' order; "
        "every tick while there are any. Their forces are the last ones in `applied_wrench`"
    ),
)
APPLIED_WRENCH = Topic(
    "applied_wrench",
    "sensor_msgs/msg/MultiDOFJointState",
    STREAM,
    "sim_node → all",
    session=SessionPlace.FRAME_ID,
    is_of_tick=True,
    content=(
        "the pushes that really acted during the previous tick, as `effort` reports the "
        "torques, and behind them the forces of the pins; every tick, also when empty"
    ),
)
CONTACTS = Topic(
    "contacts",
    "sensor_msgs/msg/MultiDOFJointState",
    STREAM,
    "sim_node → all",
    session=SessionPlace.FRAME_ID,
    is_of_tick=True,
    content=(
        "links that touched something during the previous tick, and the net contact force "
        "and torque on each: world axes, the torque about the link's centre of mass in the "
        "state in which the contact acted; mean over the tick's substeps; every tick, also "
        "when empty. It excludes the torque of the rolling and spinning friction that a "
        "URDF defines, because the engine does not report that torque"
    ),
)
IMU = Topic(
    "imu/NAME",
    "sensor_msgs/msg/Imu",
    STREAM,
    "sim_node → all",
    kept=Kept.IF_NAMED,
    is_of_tick=True,
    content=(
        "an IMU of the character's file: orientation in `odom`, angular velocity and "
        "specific force in the sensor's frame, which is `frame_id`; the specific force is "
        "the difference of velocities over the previous tick, in the axes at the stamp; "
        "none (covariance -1) in the first state of an episode"
    ),
)
FORCE = Topic(
    "force/NAME",
    "geometry_msgs/msg/WrenchStamped",
    STREAM,
    "sim_node → all",
    kept=Kept.IF_NAMED,
    is_of_tick=True,
    content=(
        "a force sensor of the character's file: the wrench of all contacts on its link, "
        "mean over the previous tick, in the sensor's frame at the stamp and about its "
        "origin"
    ),
)
THROW = Topic(
    "throw",
    "sensor_msgs/msg/JointState",
    STREAM,
    "any node → sim_node",
    of_world=True,
    session=SessionPlace.FRAME_ID_IF_ANY,
    content=(
        "a ball to throw: `name` has `mass`, `radius`, `x`, `y`, `z`, `vx`, `vy`, `vz`, "
        "`position` their values (kg, m, m/s, world); without `radius` the ball has that of "
        "500 kg/m³; with `size_x`, `size_y`, `size_z` (m) in its place a box, turned by `yaw` "
        "(rad about z; 0 if left out)"
    ),
)
APPLIED_THROW = Topic(
    "applied_throw",
    "sensor_msgs/msg/JointState",
    STREAM,
    "sim_node → all",
    of_world=True,
    session=SessionPlace.FRAME_ID,
    content=(
        "a ball or box released at the beginning of the previous tick, with all its numbers; only "
        "when there was one"
    ),
)
THROWN = Topic(
    "thrown",
    "sensor_msgs/msg/MultiDOFJointState",
    STREAM,
    "sim_node → all",
    of_world=True,
    session=SessionPlace.FRAME_ID,
    content=(
        "centre, orientation and velocities of the balls and boxes `ball_1`, `box_2`, ... in the "
        "order of their throws; every tick while "
        "there are any. With several characters, `throw`, `applied_throw` and `thrown` "
        "belong to the world, without a character's name"
    ),
)
ODOM = Topic(
    "odom",
    "nav_msgs/msg/Odometry",
    STREAM,
    "sim_node → all",
    is_of_tick=True,
    content=(
        "the frame `base_link` in `odom`, for ROS tools; twist in the child frame; "
        "covariances of 1e-9 on the diagonal, because the values are exact and zero would "
        "mean unknown"
    ),
)
ROBOT_DESCRIPTION = Topic(
    "robot_description",
    "std_msgs/msg/String",
    LATCHED,
    "sim_node → all",
    content=(
        "latched: the URDF, meshes as `file://`, with `base_link` as its root; for "
        "characters with ball joints, capsules, a scale or incomplete limits one of hinges, "
        "cylinders and spheres with the same masses, shapes and frames"
    ),
)
DESCRIPTION_JOINT_STATES = Topic(
    "description_joint_states",
    "sensor_msgs/msg/JointState",
    DISPLAY,
    "sim_node → all",
    content=(
        "position of each joint of `robot_description`; a ball joint is three: yaw, pitch, roll"
    ),
)
TF = Topic(
    "/tf",
    "tf2_msgs/msg/TFMessage",
    DISPLAY,
    "sim_node → all",
    of_world=True,
    content="[the frames](#frames) that move, where `tf2_msgs` can be imported",
)
TF_STATIC = Topic(
    "/tf_static",
    "tf2_msgs/msg/TFMessage",
    LATCHED,
    "sim_node → all",
    of_world=True,
    content=(
        "latched: fixed joints, fixed bases and `world` → `odom`, where `tf2_msgs` can be imported"
    ),
)
CONTACT_WRENCH = Topic(
    "contact_wrenches/LINK",
    "geometry_msgs/msg/WrenchStamped",
    DISPLAY,
    "sim_node → all",
    kept=Kept.IF_NAMED,
    content=(
        "`contacts` for viewers, of each link with collision shapes: force and torque in "
        "the link's frame, about its origin; zero without contact. Characters other than "
        "letters, digits and `_` in the link's name become `_`"
    ),
)
VISUALIZATION = Topic(
    "visualization",
    "visualization_msgs/msg/MarkerArray",
    DISPLAY,
    "sim_node → all",
    content=(
        "the shapes in the frame `world`, and those of balls while there are any (with "
        "several characters, each character's message has the balls), `display_rate` times "
        "per simulated second, like the three before it"
    ),
)
ROBOT_JOINT_STATES = Topic(
    "robot_joint_states",
    "sensor_msgs/msg/JointState",
    STREAM,
    "ros2_control_bridge → controller manager",
    kept=Kept.IF_NAMED,
    content=(
        "the state for [ros2_control](ros2_control.md), at its update rate and stamped with its "
        "time: all hinges and sliders that have a motor, `effort` zero in an episode's first state"
    ),
)
ROBOT_JOINT_COMMANDS = Topic(
    "robot_joint_commands",
    "sensor_msgs/msg/JointState",
    STREAM,
    "controller manager → ros2_control_bridge",
    kept=Kept.IF_NAMED,
    content=(
        "its answer, with whatever stamp: `position`, `velocity` and `effort` of each name, or "
        "none; a number that is not finite commands nothing"
    ),
)
INITIAL_STATE = Topic(
    "~/initial_state",
    "sensor_msgs/msg/JointState",
    LATCHED,
    "controller_node → sim_node",
    nodes=(CONTROLLER_NODE,),
    content=(
        "latched, stamp 0: position and velocity of all DoF at the reference's start; a "
        "simulator with `initial_state: reference` begins there"
    ),
)
REFERENCE = Topic(
    "~/reference",
    "sensor_msgs/msg/JointState",
    STREAM,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    session=SessionPlace.FRAME_ID_IF_ANY,
    is_measured=True,
    content=(
        "the desired state *at* its stamp, which is the stamp of the torque computed from "
        "it; stable PD itself looks at the reference one tick later"
    ),
)
NET_WRENCH = Topic(
    "~/net_wrench",
    "geometry_msgs/msg/WrenchStamped",
    STREAM,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content=(
        "force and torque on the whole character of all the efforts that answer the stamp's "
        "state: world axes, the torque about the base link's origin. Joint torques act and "
        "react inside the character, so alone they give zero; a nonzero value is the root's"
    ),
)
JOINT_TRAJECTORY = Topic(
    "~/joint_trajectory",
    "trajectory_msgs/msg/JointTrajectory",
    STREAM,
    "any node → controller_node",
    nodes=(CONTROLLER_NODE,),
    accepted_on="~/active_trajectory",
    content=(
        "a trajectory to track from its stamp on, in place of the present reference; stamp "
        "0: from the next answered state on. Unnamed DoF stop"
    ),
)
ACTIVE_TRAJECTORY = Topic(
    "~/active_trajectory",
    "trajectory_msgs/msg/JointTrajectory",
    LATCHED,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content=(
        "latched: the last accepted trajectory, stamped with its start; the episode's end "
        "discards it"
    ),
)
CMD_VEL = Topic(
    "cmd_vel",
    "geometry_msgs/msg/Twist",
    STREAM,
    "any node → controller_node",
    content=(
        "with `reference: steered`: a velocity to reach in the character's own frame, from "
        "the next answered state on; `steering.timeout` s of simulated time later it stops, "
        "unless another one comes"
    ),
)
CMD_VEL_STAMPED = Topic(
    "cmd_vel_stamped",
    "geometry_msgs/msg/TwistStamped",
    STREAM,
    "any node → controller_node",
    accepted_on="~/active_cmd_vel",
    content="the same from its stamp on; stamp 0: from the next answered state on",
)
ACTIVE_CMD_VEL = Topic(
    "~/active_cmd_vel",
    "geometry_msgs/msg/TwistStamped",
    CHANGES,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content=(
        "latched: each accepted velocity, within the limits, stamped with its start; a "
        "replay sends these"
    ),
)
STRENGTH = Topic(
    "~/strength",
    "sensor_msgs/msg/JointState",
    STREAM,
    "any node → controller_node",
    nodes=(CONTROLLER_NODE,),
    accepted_on="~/active_strength",
    content=(
        "strengths of joints, 0 to 1, in `effort`, `name` being joints: factors on their "
        "gains and effort limits. They hold from the stamp on, with stamp 0 from the next "
        "answered state on, until the next message or the episode's end; unnamed joints are "
        "at 1"
    ),
)
ACTIVE_STRENGTH = Topic(
    "~/active_strength",
    "sensor_msgs/msg/JointState",
    CHANGES,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content="latched: the last accepted strengths, of all joints, stamped with their first tick",
)
BEHAVIOUR = Topic(
    "~/behaviour",
    "sensor_msgs/msg/JointState",
    STREAM,
    "any node → controller_node",
    nodes=(CONTROLLER_NODE,),
    accepted_on="~/active_behaviour",
    content=(
        "with `behaviour: active_ragdoll` or `reactive`: what of it is wanted, as the only "
        "`name`: `react`, as without any message; `get_up`, without reacting to hits, and at once "
        "if it lies; `track`; or `brace`, to track with joints `brace.stiffness` times as stiff. "
        "It holds from the stamp on, with stamp 0 from the next answered state on, until the next "
        "message or the episode's end"
    ),
)
ACTIVE_BEHAVIOUR = Topic(
    "~/active_behaviour",
    "sensor_msgs/msg/JointState",
    CHANGES,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content="latched: the last accepted message on `~/behaviour`, stamped with its first tick",
)
MODE = Topic(
    "~/mode",
    "std_msgs/msg/String",
    CHANGES,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    is_measured=True,
    content=(
        "latched, JSON: `mode`, `stamp_ns` of the state from which it holds, and its cause "
        "(the link struck and the impulse, the clip found and its distance, the "
        "assistance); at an episode's start and at each change"
    ),
)
PLAN = Topic(
    "~/plan",
    "sensor_msgs/msg/PointCloud2",
    STREAM,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content=(
        "one message per plan, stamped with the first state in which the plan acts, with "
        "one point per check: the expected centre of mass (`x`, `y`, `z`, world) at `time` "
        "s after that state, the cost of the deviations there for the plan and for the best "
        "other candidate (`cost`, `alternative`), and the place of the reference's world "
        "(`anchor_x`, `anchor_y`, `anchor_yaw`, m and rad); of a policy, one per decision, with "
        "one point: where the centre of mass is, and 1 less what is expected of it"
    ),
)
CLOCK = Topic(
    "/clock",
    "rosgraph_msgs/msg/Clock",
    STREAM,
    "sim_node → all",
    of_world=True,
    content="every tick; of a controller manager `ros2_control_bridge` has the clock",
)
EPISODE = Topic(
    "episode",
    "std_msgs/msg/Header",
    LATCHED,
    "sim_node → all",
    session=SessionPlace.EPISODE,
    content="latched: stamp of the episode's first state; number and session in `frame_id`",
)
CONFIGURATION = Topic(
    "~/configuration",
    "std_msgs/msg/String",
    LATCHED,
    "sim_node → all",
    nodes=(SIM_NODE,),
    kept=Kept.ALWAYS,
    session=SessionPlace.CONFIGURATION,
    is_measured=True,
    content=(
        "latched, JSON: character file, URDF text, that of the terrain, parameters (the initial "
        "state among them) and the stamp after which they are in force, its `session`, versions of "
        "package, engines, numpy, Python and C library; again at a reset with changed parameters"
    ),
)
CONTROLLER_CONFIGURATION = Topic(
    "~/configuration",
    "std_msgs/msg/String",
    LATCHED,
    "controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content="the same of the controller, and SHA-256 of the files that it has read; again at each "
    "change of its parameters",
)
_KEYFRAME = Topic(
    "~/keyframe",
    "sensor_msgs/msg/CompressedImage",
    DISPLAY,
    session=SessionPlace.FRAME_ID,
)
KEYFRAME = replace(
    _KEYFRAME,
    way="sim_node → all",
    nodes=(SIM_NODE,),
    of_world=True,
    content=(
        "no picture, but all that the simulator goes on from in the stamp's state, compressed: "
        "every `keyframe_period`, but while a push acts; a fork begins there"
    ),
)
CONTROLLER_KEYFRAME = replace(
    _KEYFRAME,
    way="controller_node → all",
    nodes=(CONTROLLER_NODE,),
    content="the same of the controller, before it answers the stamp's state",
)
DIAGNOSTICS = Topic(
    "/diagnostics",
    "diagnostic_msgs/msg/DiagnosticArray",
    STREAM,
    "both nodes → all",
    of_world=True,
    is_measured=True,
    content=(
        "one status per character: counts of commands by verdict, pushes, pins, saturations, tick "
        "times, lateness, ages of commands, faults, and warnings left out of the log after "
        "100 different ones; each second and at the end. `hardware_id` is the character in "
        "its namespace (`left/humanoid`), the same in both nodes' statuses. WARN: of the "
        "deadlines since the report before, at least a hundred, more than 1 % were missed; "
        "ERROR: the node has a fault"
    ),
)
JOINT_STATES_THROTTLE = JOINT_STATES.throttled
CONTACTS_THROTTLE = replace(
    CONTACTS.throttled,
    content=(
        "of `contacts` the first message in each sixtieth of a second of wall time; the last one "
        "only if the contacts of its tick were found; for displays alone"
    ),
)
APPLIED_WRENCH_THROTTLE = APPLIED_WRENCH.throttled
THROWN_THROTTLE = THROWN.throttled
REFERENCE_THROTTLE = REFERENCE.throttled

TABLE = tuple(
    value for name, value in list(globals().items()) if isinstance(value, Topic) and name[0] != "_"
)
"""All topics, in the order of the documentation."""


def contact_wrench(link: str) -> Topic:
    """The topic of the contact wrench on a link; what no topic's name can have becomes `_`."""
    name = re.sub(r"\W|^(?=\d)", "_", link, flags=re.ASCII)
    return replace(CONTACT_WRENCH, name=CONTACT_WRENCH.name.replace("LINK", name))


_SENSORS = {SensorType.IMU: IMU, SensorType.FORCE: FORCE}


def sensor_reading(sensor_type: SensorType, name: str) -> Topic:
    """The topic of a sensor's readings; `name` is that of `Sensor.topic`."""
    return replace(_SENSORS[sensor_type], name=name)
