"""One character's part in a simulation: efforts and wrenches in, its state and contacts out."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.joints.effort_limits import EffortLimits
from msgs_config.character.model import Character
from msgs_config.errors import SimulationError
from msgs_config.messages.state import StampedState
from sim_node.initial_state import check_length
from sim_node.physics.engine import Balls, Body
from sim_node.physics.mass_factors import with_mass_factors
from sim_node.physics.passive_forces import PassiveForces
from sim_node.physics.pin_forces import PinForces
from sim_node.physics.pins import Pin, changed_pins
from sim_node.physics.short_links import speed_bounds
from sim_node.physics.wrenches import ExternalWrench


@dataclass(frozen=True)
class CharacterSetup:
    """A character, what of it may be commanded, and where it begins."""

    character: Character
    commanded_joints: tuple[str, ...]
    initial_position: tuple[float, ...]  # (n,)
    initial_velocity: tuple[float, ...]  # (n,)
    name: str = ""  # the character's name, where there are several
    mass_factors: tuple[str, ...] = ()  # see `with_mass_factors`

    @property
    def prefix(self) -> str:
        """What distinguishes the names of its links and joints from another character's."""
        return f"{self.name}/" if self.name else ""


@dataclass(frozen=True)
class Contacts:
    """What touched a character's links during a tick."""

    # (links, 6) net force, N, and torque about the centre of mass, N m, world axes; of several
    # substeps the mean, with each torque about the centre at its own substep
    wrenches: FloatArray
    touching: BoolArray  # (links,)


@dataclass(frozen=True)
class CharacterSnapshot:
    """A simulated character's memory between two ticks, the engine's left aside."""

    state: StampedState
    before: StampedState | None
    contacts: Contacts | None
    pushes: tuple[ExternalWrench, ...]
    delayed: tuple[FloatArray, ...]  # (n,) each, commands on their way
    saturated_ticks: IntArray  # (b,)
    start: tuple[FloatArray, FloatArray]  # (n,) each, position and velocity of later episodes
    pins: tuple[Pin, ...] = ()
    mass_factors: tuple[str, ...] = ()  # of the setup; with others it would go on otherwise


class SimulatedCharacter:
    """A character in a world."""

    character: Character  # as it is simulated; `setup` has it as its file says
    state: StampedState
    before: StampedState | None  # the state a tick earlier; None in an episode's first one
    pushes: tuple[ExternalWrench, ...]  # those that acted during the last tick, pins' forces last
    pins: tuple[Pin, ...]  # those in force during the last tick
    balls: Balls  # the balls of its world
    speed_bounds: dict[bool, float]
    """Of every degree of freedom in the engine, rad/s or m/s; by whether there is a ground."""

    def __init__(
        self,
        setup: CharacterSetup,
        *,
        delay_ticks: int,
        step_s: float,
        substeps: int,
        speed_limit: float,
    ) -> None:
        """Check the setup, for efforts that come late by some ticks of engine steps of `step_s`.

        A speed beyond the limit, in rad/s or m/s, counts as divergence.

        Raises:
            ConfigurationError: an array or a mass does not fit the character.
            LayoutError: a commanded joint does not exist.
        """
        self.setup = setup
        self.character = with_mass_factors(setup.character, setup.mass_factors)
        self.layout = setup.character.layout
        self.commanded: BoolArray = self.layout.mask(setup.commanded_joints)
        self._limits = EffortLimits(self.layout, setup.character.effort_limits())
        self.saturated_ticks: IntArray = np.zeros(len(self._limits.values), dtype=np.intp)  # (b,)
        links = len(self.character.links)
        self._no_contacts = Contacts(np.zeros((links, 6)), np.zeros(links, dtype=np.bool_))
        self.begin_in(
            self._initial("initial_position", setup.initial_position),
            self._initial("initial_velocity", setup.initial_velocity),
        )
        self._step_s, self._period = step_s, step_s * substeps
        self._pin_forces: PinForces | None = None  # None: there was no pin yet
        self._delay_ticks = delay_ticks
        self.speed_bounds = speed_bounds(self.character, step_s, speed_limit)
        # (2, n) largest position and velocity of a sound state
        self._bounds = np.array([[np.finfo(float).max], [speed_limit]]).repeat(self.layout.size, 1)

    def begin_in(self, position: FloatArray, velocity: FloatArray) -> None:
        """Make a state, each (n,), the initial one of every world that it enters from now on.

        Followers begin where their leaders say.
        """
        coupling = self.character.coupling
        self._position, self._velocity = coupling.position(position), coupling.velocity(velocity)

    def enter(self, body: Body, balls: Balls, gravity: float, stamp_ns: int) -> None:
        """Enter a world, as the body that was added there, in the initial state.

        Its gravity is in m/s^2 along -z.
        """
        self._passive = PassiveForces(
            self.character, self._step_s, gravity, has_armature=body.has_armature
        )
        self._delayed = deque([np.zeros(self.layout.size)] * self._delay_ticks)
        self._body, self.balls = body, balls
        body.set_state(self._position, self._velocity)
        self._contacts: Contacts | None = self._no_contacts
        self._contacts_are_due = False  # the engine has them, and they were not asked for yet
        self.pushes, self.pins = (), ()
        self.before = None
        self._read(stamp_ns, effort=None)

    def begin_tick(
        self, effort: FloatArray, pushes: Sequence[ExternalWrench], watches_contacts: bool
    ) -> None:
        """Take the effort (n,) and the pushes of a tick; the pins' forces are added to these."""
        self._delayed.append(effort + 0.0)  # -0.0 becomes 0.0: a tick has one effort, to the bit
        wanted = self._delayed.popleft()
        self._applied = self._limits.clipped(wanted)
        if self._applied is not wanted:
            self.saturated_ticks += self.layout.norms(wanted) > self._limits.values
        self.pushes = (*pushes, *self._find_pin_forces())
        self._contacts = self._no_contacts if watches_contacts else None
        self._contacts_are_due = False

    def change_pins(self, changes: Sequence[Pin]) -> None:
        """Hold and let go points of links from the coming tick on."""
        if changes:
            self.pins = changed_pins(self.pins, changes)

    def _find_pin_forces(self) -> tuple[ExternalWrench, ...]:
        """The forces of the pins during the tick that begins."""
        if not self.pins:
            return ()
        if self._pin_forces is None:
            self._pin_forces = PinForces(self.character, self._period)
        return self._pin_forces.wrenches(self.pins, self.state.position, self.state.velocity)

    def begin_substep(self, first: bool) -> None:
        """Apply all forces again for one engine step."""
        total = self._applied
        if self._passive.active:
            motion = (self.state.position, self.state.velocity) if first else self._body.read()
            position, velocity = motion
            total = total + self._passive.effort(position, velocity, total, self.pushes)
            self._body.set_friction(self._passive.resistance.spare)
        self._body.apply(total)
        if self.pushes:
            self._body.push((push.link, push.wrench, push.point) for push in self.pushes)

    def add_contacts(self, share: float) -> None:
        """Add the contacts of the last engine step, which is a share of the tick.

        Where it is the whole tick, they are left to be found when they are asked for: the
        engine has them until its next step.
        """
        if share == 1.0:
            self._contacts_are_due = True
            return
        wrenches, touching = self._body.contact_wrenches()
        assert self._contacts is not None
        self._contacts = Contacts(
            self._contacts.wrenches + share * wrenches, self._contacts.touching | touching
        )

    def end_substep(self) -> None:
        """Put followers where their leaders say, if contacts have moved them away."""
        if self.character.coupling:
            self.find_contacts()  # first: contacts need the links where they were at the step
            position, velocity = self._body.read()
            if self._passive.couple(position, velocity):
                self._body.set_motion(position, velocity)

    @property
    def contacts(self) -> Contacts | None:
        """What touched its links over the last tick; None if contacts were not watched."""
        self.find_contacts()
        return self._contacts

    def find_contacts(self) -> None:
        """Find the last tick's contacts, unless it was done, before the engine forgets them."""
        if self._contacts_are_due:
            self._contacts_are_due = False
            self._contacts = Contacts(*self._body.contact_wrenches())

    def end_tick(self, stamp_ns: int) -> None:
        """Read the state that the tick has led to."""
        self.before = self.state
        self._read(stamp_ns, self._applied)

    def snapshot(self) -> CharacterSnapshot:
        """What `restore` needs, to be taken between two ticks."""
        return CharacterSnapshot(
            self.state,
            self.before,
            self.contacts,
            self.pushes,
            tuple(self._delayed),
            self.saturated_ticks.copy(),
            (self._position, self._velocity),
            self.pins,
            self.setup.mass_factors,
        )

    def restore(self, snapshot: CharacterSnapshot) -> None:
        """Restore a snapshot; the engine's state is restored by the simulation."""
        self.state, self.before = snapshot.state, snapshot.before
        self._contacts, self._contacts_are_due = snapshot.contacts, False
        self.pushes, self.pins = snapshot.pushes, snapshot.pins
        self._delayed = deque(snapshot.delayed)
        self.saturated_ticks = snapshot.saturated_ticks.copy()
        self._position, self._velocity = snapshot.start
        self._body.forget_reading()

    def link_frames(self) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m and orientations xyzw (links, 4) of the links in the world."""
        self.find_contacts()  # first: contacts need the links where they were at the step
        return self._body.link_frames()

    def base_frame(self) -> tuple[FloatArray, FloatArray]:
        """Origin (3,) in m and orientation xyzw (4,) of the base link in the world."""
        return self._body.base_frame()

    def check_divergence(self, tick: int) -> None:
        """Raise SimulationError if the state is not finite or faster than the limit."""
        sound = np.abs(self._motion) <= self._bounds  # NaN is unsound
        if np.count_nonzero(sound) < sound.size:
            state = self.state
            worst = int(np.argmin(sound.all(axis=0)))
            raise SimulationError(
                f"diverged at tick {tick}: '{self.setup.prefix}{self.layout.dof_names[worst]}' is "
                f"at {state.position[worst]:.4g} with velocity {state.velocity[worst]:.4g}; "
                f"the limit is {self._bounds[1, worst]:g}"
            )

    def _read(self, stamp_ns: int, effort: FloatArray | None) -> None:
        self._motion = self._body.read()
        position, velocity = self._motion
        self.state = StampedState(stamp_ns, position, velocity, effort)

    def _initial(self, name: str, values: tuple[float, ...]) -> FloatArray:
        below = f"{self.setup.name}." if self.setup.name else ""
        check_length(f"{below}{name}", len(values), self.layout)
        return np.array(values)
