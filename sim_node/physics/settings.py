"""What a simulation and its world are set to."""

from msgs_config.character.model import UrdfOptions
from msgs_config.settings import Settings, parameter, shared
from msgs_config.shared_parameters import COMMAND_DELAY, GRAVITY, LINK_FRICTION, PLANE, RATE
from sim_node.physics.engine import DEFAULT_ENGINE, ENGINES

STEADY_CONTACTS = {"contact_breaking_threshold": 0.1}
"""Parameters of a world in which a loaded foot stands on all of its sole, if that is a mesh."""


class WorldSettings(Settings):
    """The physics of the world. Its parameters may change at a reset."""

    engine: str = parameter(
        DEFAULT_ENGINE,
        "what simulates the world; bullet is the default where PyBullet is installed",
        choices=tuple(ENGINES),
    )
    gravity: float = shared(GRAVITY)  # m/s^2, along -z
    friction: float = parameter(
        0.9,
        "friction of the ground; a contact's is its product with the link's",
        maximum=100.0,
        at_reset=True,
    )
    link_friction: float = parameter(
        LINK_FRICTION, "friction of every link", maximum=100.0, at_reset=True
    )
    solver_iterations: int = parameter(
        10, "contact solver iterations a step", minimum=1, maximum=1000, at_reset=True
    )
    contact_breaking_threshold: float = parameter(
        0.02,
        "engine bullet: how far apart a contact's points may be until they are dropped, as a share "
        "of the smaller shape's size; with its own, 0.02, a loaded sole that is a mesh trembles",
        minimum=1e-3,
        maximum=1.0,
        at_reset=True,
    )
    step_s: float = 1.0 / 240.0  # length of one engine step
    ground: bool = True  # the plane z = 0
    terrain: UrdfOptions | None = None  # a fixed body beside the plane


class SimulationSettings(Settings):
    """All that a simulation depends on beside its setups, the efforts, pushes and throws."""

    rate_hz: int = shared(RATE)
    command_delay_ticks: int = shared(COMMAND_DELAY)
    substeps: int = parameter(1, "engine steps a tick", minimum=1, maximum=1000)
    world: WorldSettings = WorldSettings()
    terrain: str = parameter(
        PLANE,
        "the ground: plane, none, name of a shipped terrain, or path of a .yaml file or a URDF",
    )
    speed_limit: float = parameter(500.0, "a speed beyond it is a divergence", unit="rad/s or m/s")
    ball_lifetime: float = parameter(
        0.0, "a thrown ball is taken out of the way after it; 0: never", unit="s"
    )

    @property
    def step_s(self) -> float:
        """Length of an engine step in s."""
        return 1.0 / (self.rate_hz * self.substeps)

    @property
    def ball_ticks(self) -> int:
        """The ticks after which a ball is taken out of the way; 0: never."""
        return max(round(self.ball_lifetime * self.rate_hz), 1) if self.ball_lifetime else 0
