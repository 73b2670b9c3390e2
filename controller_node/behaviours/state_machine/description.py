"""What the file of a state machine says: states, their targets, and how they end."""

from dataclasses import dataclass
from pathlib import Path

from controller_node.behaviours.state_machine.support import Bounds
from controller_node.references.steering.velocity import VelocityRegion
from msgs_config.geometry.scalars import Vector

STANCE, SWING = "stance", "swing"
"""The roles of the two sides; a state's end may swap them."""

STAND, STEP, REACH, FREE = "stand", "step", "reach", "free"
FEET = (STAND, STEP, REACH, FREE)
"""What a leg does: carries, goes to a place on the ground, reaches below the hip, or has targets of
joints alone."""

HIP, CENTRE = "hip", "centre"
"""What a foot that reaches goes ahead of: its hip, or the centre of mass."""

BALANCE = "balance"
"""The effort of a stance hip that keeps the torso, by SIMBICON's balance of torques."""

_WITHOUT_LIMITS = VelocityRegion()

Gains = tuple[float, float]
"""Of an error and of its rate: 1/s^2 and 1/s of the root, N m/rad and N m s/rad of a joint."""


@dataclass(frozen=True)
class RootTarget:
    """How the root is held by the feet that stand; angles are about axes ahead and to the left."""

    height: float  # m, above the soles that stand
    roll: float = 0.0  # rad
    pitch: float = 0.0  # rad, ahead
    climb: float = 0.0  # m/s, upwards
    thrust: float = 0.0  # N, upwards, beside what height and climb need
    arrival: float = 0.0  # share of `duration` until it has height and climb; 0: by `height_gains`
    height_gains: Gains = (120.0, 22.0)
    tilt_gains: Gains = (150.0, 25.0)
    turn_gains: Gains = (60.0, 16.0)


@dataclass(frozen=True)
class PressureTarget:
    """Where the centre of pressure is, in the frame of a sole: ahead, and outward of the body."""

    ahead: float = 0.0  # m
    outward: float = 0.0  # m
    share: float = 0.5  # share of the way from the stance foot to the other one, where both stand
    gain: float = 1.5  # m for each m that the extrapolated centre of mass is off its course, ahead
    side_gain: float = 1.5  # m for each m that it is off its course sideways
    speed_gain: float = 0.0  # m for each m/s that the body is too fast


@dataclass(frozen=True)
class FootPlacement:
    """Where a foot goes, by a law of balance, and how."""

    law: str = "extrapolated"  # one of `laws.PLACEMENT_LAWS`
    width: float = 0.2  # m, of a step
    pace: float = 1.0  # the speed ahead that laws are told, as a share of the commanded one
    ahead: float = 0.0  # m, beside what the law says
    gain: float = 0.0  # s, for the law neutral
    fixed: float = 0.7  # share of `duration` after which the place ahead stays as it is
    clearance: float = 0.08  # m, of the foot at the middle of its way
    depth: float = 0.0  # m, below the other sole, where the foot's way ends
    descent: float = 0.25  # m/s, at which the foot goes on downwards after `duration`
    least_width: float = 0.1  # m, between the soles
    most_width: float = 0.6  # m
    most_ahead: float = 0.75  # m
    most_behind: float = 0.6  # m
    length: float = 0.0  # m, of a leg that reaches, from hip to sole
    origin: str = HIP  # HIP or CENTRE (of mass): what a leg that reaches goes ahead of
    carry: float = 0.0  # the share of its velocity that a leg that reaches sets out with
    retract: float = 0.0  # the share of the body's speed at which it goes back as it lands
    stance_time: float = 0.0  # s that it will stand, for the law neutral; 0: the state's duration


@dataclass(frozen=True)
class Feedback:
    """SIMBICON's feedback on the angle of a hip: rad/m and rad s/m."""

    sagittal: Gains = (0.0, 0.0)
    coronal: Gains = (0.0, 0.0)


@dataclass(frozen=True)
class Likeness:
    """A joint that goes with a leg, as an arm does with that of the other side."""

    role: str  # the leg's role
    share: Vector  # rad, in joint axes, for each rad that the leg is ahead


@dataclass(frozen=True)
class JointTarget:
    """A joint's target for a swing leg on the left; it is mirrored for one on the right."""

    joint: str  # its name, or a role and a part, such as `swing.knee`
    value: Vector  # joint axes: rotation vector, or the angle first; world: roll, pitch, yaw; rad
    in_world: bool = False  # axes ahead, to the left and up of the way that it is to face
    feedback: Feedback = Feedback()
    size: int = 3  # numbers that the file has
    likeness: Likeness | None = None


@dataclass(frozen=True)
class Condition:
    """A quantity that is above, or below, a value."""

    quantity: str
    above: bool
    value: float

    def holds(self, value: float) -> bool:
        """Whether it does, of a value of the quantity."""
        return value > self.value if self.above else value < self.value


QUANTITIES = {
    "time": "s in the state",
    "progress": "time in the state over its duration",
    "stance_load": "N on the stance foot",
    "swing_load": "N on the swing foot",
    "load": "N on both feet",
    "height": "m of the root above the lower sole",
    "climb": "m/s of the centre of mass upwards",
    "speed": "m/s of the centre of mass ahead",
    "motion": "m/s of the centre of mass over the ground",
    "command": "m/s and rad/s, the largest part of the commanded velocity",
    "command_ahead": "m/s, the commanded velocity ahead",
    "sway": "m from the stance sole towards the other, of the extrapolated centre of mass",
    "imbalance": "m of the extrapolated centre of mass outside of what the feet bear",
}
"""What conditions may ask for, and its unit."""


@dataclass(frozen=True)
class End:
    """An end of a state, where all of its conditions hold."""

    then: str
    conditions: tuple[Condition, ...]
    swap: bool = False  # whether the sides swap their roles

    @property
    def takes_time(self) -> bool:
        """Whether it needs the state to have lasted for a time."""
        timed = [c for c in self.conditions if c.quantity in ("time", "progress")]
        return any(c.above and c.value > 0.0 for c in timed)


@dataclass(frozen=True)
class State:
    """A state of a machine."""

    name: str
    feet: dict[str, str]  # by role: one of `FEET`
    duration: float  # s in which a foot that goes somewhere gets there
    blend: float  # s, in which targets come over from the state before
    root: RootTarget
    pressure: PressureTarget
    placement: FootPlacement
    targets: tuple[JointTarget, ...]
    gains: dict[str, Gains]  # by joint as in `targets`
    efforts: dict[str, str | tuple[float, ...]]  # by joint as in `targets`: `BALANCE`, or N m
    bounds: Bounds
    ends: tuple[End, ...]
    tracks: bool = False  # whether the control law tracks the targets, not inverse dynamics

    @property
    def step_time(self) -> float:
        """When a foot that steps meets an even ground, s: later where its way ends above it."""
        placement = self.placement
        late = -placement.depth / placement.descent if placement.descent > 0.0 else 0.0
        return self.duration + max(late, 0.0)

    @property
    def standing(self) -> tuple[str, ...]:
        """The roles of the feet that carry."""
        return tuple(role for role in (STANCE, SWING) if self.feet[role] == STAND)


@dataclass(frozen=True)
class Machine:
    """A state machine: a mirrored one has one state for both sides."""

    file: Path
    sides: dict[str, dict[str, str]]  # by side: the names of its joints by their parts
    start: str
    states: dict[str, State]
    acceleration: float = 1e9  # m/s^2, at which it takes over commanded velocities
    limits: VelocityRegion = _WITHOUT_LIMITS  # bounds of the velocities that it takes

    def joint(self, name: str, stance: str) -> str:
        """The character's joint of a name in a target, where a side is the stance side."""
        role, dot, part = name.partition(".")
        if not dot:
            return name
        other = next(side for side in self.sides if side != stance)
        return self.sides[stance if role == STANCE else other][part]
