"""The parameters of `sim_node`, and the settings of the simulation that they make."""

from msgs_config.character import Character
from msgs_config.parameters import Parameter, Values
from msgs_config.shared_parameters import CHARACTER, GRAVITY, RATE
from sim_node.simulation import SimulationSettings

_LARGEST_COUNT = 2**62

PARAMETERS = [
    CHARACTER,
    RATE,
    Parameter("substeps", 1, "engine steps a tick", minimum=1, maximum=1000),
    GRAVITY,
    Parameter(
        "friction",
        0.9,
        "friction of the ground; a contact's is its product with the link's",
        maximum=100.0,
    ),
    Parameter("link_friction", 0.5, "friction of every link", maximum=100.0),
    Parameter("solver_iterations", 10, "contact solver iterations a step", minimum=1, maximum=1000),
    Parameter("speed_limit", 500.0, "a speed beyond it is a divergence", unit="rad/s or m/s"),
    Parameter(
        "command_delay_ticks", 0, "a command is applied this many ticks late", maximum=100_000
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
    Parameter("republish_period", 0.5, "an unanswered state is sent again", unit="s", minimum=0.01),
    Parameter("lockstep_timeout", 0.0, "longest wait for a command; 0: for ever", unit="s"),
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
]


def character_parameters(character: Character) -> list[Parameter]:
    """The parameters whose defaults depend on the character."""
    return [
        Parameter(
            "commanded_joints",
            character.layout.actuated_joint_names,
            "the joints that must be commanded, and that alone may be; with 'root': assistance",
            texts=True,
        ),
        Parameter(
            "initial_position",
            list(character.rest_position),
            "position of each degree of freedom at the start",
            unit="rad or m",
            minimum=-1e12,
        ),
        Parameter(
            "initial_velocity",
            [0.0] * character.layout.size,
            "velocity of each degree of freedom at the start",
            unit="rad/s or m/s",
            minimum=-1e12,
        ),
    ]


def make_settings(values: Values) -> SimulationSettings:
    """The settings of the simulation that the parameters' values say."""
    return SimulationSettings(
        rate_hz=values.integer("rate"),
        substeps=values.integer("substeps"),
        gravity=values.number("gravity"),
        friction=values.number("friction"),
        link_friction=values.number("link_friction"),
        solver_iterations=values.integer("solver_iterations"),
        speed_limit=values.number("speed_limit"),
        command_delay_ticks=values.integer("command_delay_ticks"),
        commanded_joints=values.texts("commanded_joints"),
        initial_position=values.numbers("initial_position"),
        initial_velocity=values.numbers("initial_velocity"),
    )
