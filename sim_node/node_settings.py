"""What `sim_node` itself is set to, beside the simulation."""

from msgs_config.character.sensors import LARGEST_NOISE, SensorType
from msgs_config.character.urdf.ros2_control import COMMAND_INTERFACES
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock
from msgs_config.messages.session import GivenSession
from msgs_config.settings import Settings, parameter, shared
from msgs_config.shared_parameters import GRAVITY, RATE, KeyframeSettings
from sim_node.frames import FrameNames
from sim_node.named_numbers import named_numbers

_LARGEST_COUNT = 2**62


class SensingSettings(Settings):
    """What readings depend on beside states, contacts and the sensor itself.

    Raises ConfigurationError if the noise is of no quantity that a sensor measures.
    """

    rate_hz: int = shared(RATE)
    gravity: float = shared(GRAVITY)  # m/s^2, along -z
    seed: int = parameter(0, "of the noise of sensors", name="sensor_seed", maximum=_LARGEST_COUNT)
    noise: tuple[str, ...] = parameter(
        (),
        "standard deviation of the white noise of all sensors, in place of that in the character's "
        "file: QUANTITY:DEVIATION, such as angular_velocity:0.02, in the quantity's unit",
        name="sensor_noise",
    )

    def __post_init__(self) -> None:
        self.deviations()

    def deviations(self) -> dict[str, float]:
        """The standard deviations of white noise, by quantities."""
        names = [quantity for kind in SensorType for quantity in kind.quantities]
        return named_numbers("sensor_noise", self.noise, "quantity", names, (0.0, LARGEST_NOISE))

    @property
    def tick_s(self) -> float:
        """Length of a tick in s."""
        return 1.0 / self.rate_hz


class NodeSettings(Settings):
    """All that the node depends on beside the simulation and its settings.

    Raises ConfigurationError if the session is no session id, or a frame's name cannot be one.
    """

    rate_hz: int = shared(RATE)
    mode: str = parameter(
        "lockstep",
        "wait for the answer to each state, or go on with the wall clock",
        choices=("lockstep", "realtime"),
    )
    real_time_factor: float = parameter(
        0.0,
        "simulated time over wall time; 0: lockstep as fast as it can, realtime at 1",
        maximum=1000.0,
        live=True,
    )
    command_timeout: float = parameter(
        0.2, "realtime: a command is held this long, then zero", unit="s", minimum=0.001, live=True
    )
    max_ticks: int = parameter(
        0, "end after this many ticks; 0: never", unit="ticks", maximum=_LARGEST_COUNT
    )
    wait_for_subscribers: int = parameter(
        0, "publish the first state when this many subscribe to joint_states", maximum=1000
    )
    initial_state_timeout: float = parameter(
        60.0,
        "longest wait for a controller that publishes where a character begins; 0: no limit",
        unit="s",
    )
    republish_period: float = parameter(
        0.5, "an unanswered state is sent again", unit="s", minimum=0.01
    )
    lockstep_timeout: float = parameter(0.0, "longest wait for a command; 0: forever", unit="s")
    on_timeout: str = parameter(
        "abort",
        "what a timeout does: end, pause, or go on with the last command or zero",
        choices=("abort", "pause", "hold", "zero"),
    )
    on_fault: str = parameter(
        "pause", "what a conflict of commands or a divergence does", choices=("abort", "pause")
    )
    wrench_duration: float = parameter(
        0.1, "a push is held this long, at least a tick", unit="s", live=True
    )
    step_count: int = parameter(
        1,
        "ticks of one call of ~/step",
        unit="ticks",
        minimum=1,
        maximum=1_000_000_000,
        live=True,
    )
    display_rate: float = parameter(
        30.0,
        "`visualization`, `/tf`, `description_joint_states` and `contact_wrenches` a second of "
        "simulated time",
        unit="Hz",
        minimum=0.001,
        maximum=1000.0,
    )
    ros2_control: tuple[str, ...] = parameter(
        (),
        "robot_description has a tag of ros2_control with these command interfaces; empty: no tag",
        choices=COMMAND_INTERFACES,
    )
    sensing: SensingSettings = SensingSettings()
    frames: FrameNames = FrameNames()
    keyframes: KeyframeSettings = KeyframeSettings()
    session: GivenSession = GivenSession()  # without one, the node makes one

    @property
    def is_realtime(self) -> bool:
        """Whether the wall clock ends a tick, instead of the commands."""
        return self.mode == "realtime"

    @property
    def tick_period(self) -> float:
        """Wall time from tick to tick in s; 0: as fast as it goes."""
        factor = self.real_time_factor or float(self.is_realtime)
        return 1.0 / (factor * self.rate_hz) if factor else 0.0

    @property
    def command_timeout_ns(self) -> int:
        """Simulated time that a command is held for in real time, ns."""
        return round(self.command_timeout * NANOSECONDS_PER_SECOND)

    @property
    def push_ticks(self) -> int:
        """The ticks that a push lasts."""
        return max(round(self.wrench_duration * self.rate_hz), 1)

    @property
    def display_ticks(self) -> int:
        """The ticks between two messages for viewers."""
        return max(round(self.rate_hz / self.display_rate), 1)

    @property
    def clock(self) -> TickClock:
        """The stamps of ticks."""
        return TickClock(self.rate_hz)
