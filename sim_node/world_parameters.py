"""The parameters of `sim_node` that all characters of its world have in common."""

from msgs_config.messages.session import SESSION
from msgs_config.parameters import Parameter
from msgs_config.shared_parameters import (
    COMMAND_DELAY,
    GRAVITY,
    KEYFRAME,
    KEYFRAME_PERIOD,
    PLANE,
    RATE,
)
from sim_node.frames import BASE_FRAME_PARAMETER, ODOM_FRAME

_LARGEST_COUNT = 2**62

CONTACT_BREAKING_THRESHOLD = "contact_breaking_threshold"
STEADY_CONTACTS = {CONTACT_BREAKING_THRESHOLD: 0.1}
"""Parameters of a world in which a loaded foot stands on all of its sole."""

WORLD_PARAMETERS = [
    RATE,
    Parameter("substeps", 1, "engine steps a tick", minimum=1, maximum=1000),
    GRAVITY,
    Parameter(
        "friction",
        0.9,
        "friction of the ground; a contact's is its product with the link's",
        maximum=100.0,
        at_reset=True,
    ),
    Parameter("link_friction", 0.5, "friction of every link", maximum=100.0, at_reset=True),
    Parameter("terrain", PLANE, "the ground: plane, none, or the path of a URDF"),
    Parameter(
        "solver_iterations",
        10,
        "contact solver iterations a step",
        minimum=1,
        maximum=1000,
        at_reset=True,
    ),
    Parameter(
        CONTACT_BREAKING_THRESHOLD,
        0.02,
        "how far apart a contact's points may be until the engine drops them, as a share of the "
        "smaller shape's size; with the engine's own, 0.02, a loaded foot trembles on its edges",
        minimum=1e-3,
        maximum=1.0,
        at_reset=True,
    ),
    Parameter("speed_limit", 500.0, "a speed beyond it is a divergence", unit="rad/s or m/s"),
    COMMAND_DELAY,
    Parameter(
        "mode",
        "lockstep",
        "wait for the answer to each state, or go on with the wall clock",
        choices=("lockstep", "realtime"),
    ),
    Parameter(
        "real_time_factor",
        0.0,
        "simulated time over wall time; 0: lockstep as fast as it can, realtime at 1",
        maximum=1000.0,
        live=True,
    ),
    Parameter(
        "command_timeout",
        0.2,
        "realtime: a command is held this long, then zero",
        unit="s",
        minimum=0.001,
        live=True,
    ),
    Parameter(
        "max_ticks", 0, "end after this many ticks; 0: never", unit="ticks", maximum=_LARGEST_COUNT
    ),
    Parameter(
        "wait_for_subscribers",
        0,
        "publish the first state when this many subscribe to joint_states",
        maximum=1000,
    ),
    Parameter(
        "initial_state_timeout",
        60.0,
        "longest wait for a controller that publishes where a character begins; 0: no limit",
        unit="s",
    ),
    Parameter("republish_period", 0.5, "an unanswered state is sent again", unit="s", minimum=0.01),
    Parameter("lockstep_timeout", 0.0, "longest wait for a command; 0: forever", unit="s"),
    Parameter(
        "on_timeout",
        "abort",
        "what a timeout does: end, pause, or go on with the last command or zero",
        choices=("abort", "pause", "hold", "zero"),
    ),
    Parameter(
        "on_fault",
        "pause",
        "what a conflict of commands or a divergence does",
        choices=("abort", "pause"),
    ),
    Parameter(
        "wrench_duration", 0.1, "a push is held this long, at least a tick", unit="s", live=True
    ),
    Parameter(
        "ball_lifetime", 0.0, "a thrown ball is taken out of the way after it; 0: never", unit="s"
    ),
    Parameter(
        "step_count",
        1,
        "ticks of one call of ~/step",
        unit="ticks",
        minimum=1,
        maximum=1_000_000_000,
        live=True,
    ),
    Parameter(
        "display_rate",
        30.0,
        "`visualization`, `/tf`, `description_joint_states` and `contact_wrenches` a second of "
        "simulated time",
        unit="Hz",
        minimum=0.001,
        maximum=1000.0,
    ),
    Parameter(
        "sensor_seed",
        0,
        "of the noise that a character's file gives its sensors",
        maximum=_LARGEST_COUNT,
    ),
    ODOM_FRAME,
    BASE_FRAME_PARAMETER,
    KEYFRAME_PERIOD,
    KEYFRAME,
    SESSION,
]
