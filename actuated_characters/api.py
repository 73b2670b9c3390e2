"""Simulation and controller for Python, without ROS; the states are those of `run`, to the bit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from actuated_characters.given_arrays import (
    finite_state,
    has_arrays,
    is_finite,
    is_same_first,
    real_array,
)
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.runs.plan import choose_reference, make_plan
from controller_node import parameters as controller_parameters
from controller_node.behaviours.factory import make_motion
from controller_node.references.base import Reference
from msgs_config.arrays import FloatArray
from msgs_config.character.joints.followers import check_undriven
from msgs_config.character.model import Character
from msgs_config.errors import CommandError, ConfigurationError, SimulationError
from msgs_config.messages.state import StampedReference, StampedState
from msgs_config.parameters import Values
from msgs_config.plain_values import finite_numbers, plain_parameters
from msgs_config.shared_parameters import placed
from sim_node import parameters as simulator_parameters
from sim_node.initial_state import as_values
from sim_node.node_settings import NodeSettings
from sim_node.physics import simulation
from sim_node.physics.settings import SimulationSettings
from sim_node.physics.wrenches import ExternalWrench, WrenchQueue
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

if TYPE_CHECKING:
    from sensor_msgs.msg import JointState

_NOTHING: Mapping[str, object] = MappingProxyType({})


class Controller:
    """Inverse dynamics: the efforts that `controller_node` answers a state with."""

    def __init__(
        self,
        character: Character,
        parameters: Mapping[str, object] = _NOTHING,
        **more: object,
    ) -> None:
        """Make a controller of `controller_node`'s parameters.

        Args:
            character: As `load_character` gives it.
            parameters: By name (docs/parameters.md), such as `{"gains.right_knee.p": 300.0}`.
            more: The same for names without a dot. `clip` and `keyframes` choose the reference.

        Raises:
            ActuatedCharactersError: a name or a value is wrong.
        """
        given = plain_parameters(parameters, more)
        given = {**choose_reference(given), **given}
        self.character = placed(character, given)
        self._values = controller_parameters.resolve_for(self.character, given)
        motion = make_motion(self.character, self._values)
        self.reference: Reference = motion.reference
        self.start = motion.first_state()
        """The state in which the reference begins."""
        self._controller = controller_parameters.make_controller(
            self.character, motion.reference, self._values
        )
        self._last: StampedState | None = None  # the last state that was answered
        self._episode_ns = 0
        joints = controller_parameters.commanded_joints(self.character, self._values)
        self._commanded = self.character.layout.mask(joints)
        self._drives_all = bool(self._commanded.all())

    @property
    def needs_contacts(self) -> bool:
        """Whether its behaviour, or a planner that feels the ground, looks at contacts."""
        return self._controller.needs_contacts

    def compute_effort(self, state: StampedState, contacts: FloatArray | None = None) -> FloatArray:
        """The effort (n,) for a state, N and N m; zero where it commands nothing.

        An episode begins with a state without effort, unless it is the last state once more; all
        that the controller keeps is of the episode. Frames: docs/topics.md.

        Args:
            state: Of the present tick.
            contacts: Net wrenches (links, 6) of the tick before, world axes, if it looks at them.

        Raises:
            ActuatedCharactersError: the stamp is no tick, or contacts are missing.
        """
        effort, _ = self.compute(state, contacts)
        return effort

    def compute(
        self, state: StampedState, contacts: FloatArray | None = None
    ) -> tuple[FloatArray, StampedReference]:
        """As `compute_effort`, and the desired state at the state's stamp."""
        if not has_arrays(state, self.character.layout.size):
            state = finite_state(state, self.character.layout.size)
        if contacts is not None and self.needs_contacts:
            contacts = self._checked_contacts(contacts)
        last = self._last
        if last is None or (state.effort is None and not is_same_first(state, last)):
            self._controller.begin_episode(state.stamp_ns)
            self._episode_ns = state.stamp_ns
        effort, reference = self._controller.compute_effort(state, self._episode_ns, contacts)
        self._last = state
        if self._drives_all:  # a copy: the effort may be a row of the series that the law applies
            return effort.copy(), reference
        return np.where(self._commanded, effort, 0.0), reference

    def _checked_contacts(self, contacts: FloatArray) -> FloatArray:
        contacts = real_array("contacts", contacts)
        shape = (len(self.character.links), 6)
        if contacts.shape != shape:
            raise ConfigurationError(f"contacts have shape {contacts.shape}; it must be {shape}")
        return contacts

    def compute_command(self, message: "JointState") -> "JointState":
        """The message for `joint_torques` that answers one of `joint_states`.

        Raises:
            ActuatedCharactersError: the message is no state of the character.
        """
        from msgs_config.bus.ros_state import effort_message, read_state

        layout = self.character.layout
        effort = self.compute_effort(read_state(layout, message))
        return effort_message(layout, message.header, effort, self._commanded)


@dataclass(frozen=True)
class SimulationSnapshot:
    """A state of a `Simulation` and all that follows from it; it can be pickled."""

    character: tuple[str, ...]  # its file's name, and those of its degrees of freedom
    world: simulation.Snapshot
    first_tick: int  # number of the episode's first tick
    pushes: tuple[ExternalWrench, ...]  # pushes that wait for their time, or still act
    states: StateHash  # hash over all states so far


class Simulation:
    """Forward dynamics: one character in its world, a tick a step, as `sim_node` simulates it."""

    def __init__(
        self,
        character: Character,
        start: StampedState | None = None,
        parameters: Mapping[str, object] = _NOTHING,
        *,
        watch_contacts: bool = True,
        **more: object,
    ) -> None:
        """Build the world.

        Args:
            character: As `load_character` gives it.
            start: Where it begins, such as a controller's `start`; None: in its rest pose.
            parameters: Of `sim_node`, by name (docs/parameters.md).
            watch_contacts: Find out what touches, where `contacts` is read; with `substeps` in
                each of them, read or not, which takes a fifth of a step's time.
            more: The same for names without a dot, such as `gravity=3.71`.

        Raises:
            ActuatedCharactersError: a name or a value is wrong.
        """
        given = plain_parameters(parameters, more)
        self._values = simulator_values(character, start, given)
        setup = make_character_setup(placed(character, given), self._values)
        self.character = setup.character
        self._simulation = simulation.Simulation([setup], make_simulation_settings(self._values))
        self._simulation.watches_contacts = watch_contacts
        self._drives_all = bool(self._simulation.characters[0].commanded.all())
        self._pushes = WrenchQueue(character)
        self._hash = StateHash()
        self._first_tick = self._simulation.tick

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __reduce__(self) -> NoReturn:
        raise SimulationError(
            "a Simulation can be neither copied nor pickled; its snapshot() can, and another one "
            "of the same character and parameters goes on from that by restore()"
        )

    def close(self) -> None:
        """End the engine; a closed simulation stays closed, and all that needs it is an error."""
        self._simulation.close()

    @property
    def state(self) -> StampedState:
        """The present state; without effort if it is an episode's first.

        Raises:
            ClosedError: the simulation is closed.
        """
        self._simulation.check_open()
        return self._simulation.characters[0].state

    @property
    def settings(self) -> SimulationSettings:
        """What it depends on besides the character, where that begins, and the efforts."""
        return self._simulation.settings

    @property
    def rate_hz(self) -> int:
        """Ticks a second."""
        return self.settings.rate_hz

    @property
    def ticks(self) -> int:
        """How many ticks have passed since the episode began."""
        return self._simulation.tick - self._first_tick

    @property
    def time(self) -> float:
        """Time in s since the episode began."""
        return self.ticks / self.rate_hz

    @property
    def contacts(self) -> FloatArray:
        """Net contact wrenches (links, 6) of the last tick: N and N m, world axes.

        Raises:
            ConfigurationError: the simulation does not watch contacts.
            ClosedError: it is closed.
        """
        self._simulation.check_open()
        if not self._simulation.watches_contacts:
            raise ConfigurationError("contacts are not watched; make it with watch_contacts=True")
        contacts = self._simulation.characters[0].contacts
        if contacts is None:
            return np.zeros((len(self.character.links), 6))
        return contacts.wrenches

    @property
    def state_hash(self) -> str:
        """SHA-256 over all states that `step` has led to, as in a run's `summary.json`."""
        return self._hash.hexdigest()

    def push(
        self,
        link: str,
        force: Sequence[float] = (0.0, 0.0, 0.0),
        torque: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Push a link from the next step on, for the parameter `wrench_duration`.

        Args:
            link: Its name.
            force: N, world axes, at the link's centre of mass.
            torque: N m, world axes.

        Raises:
            CommandError: no such link, or force or torque is not three finite numbers.
            ClosedError: the simulation is closed.
        """
        self._simulation.check_open()
        wrench = [
            finite_numbers(f"the {what} on '{link}'", vector, 3, CommandError)
            for what, vector in (("force", force), ("torque", torque))
        ]
        self._pushes.add(
            [link],
            np.concatenate(wrench)[np.newaxis],
            np.zeros((0, 3)),
            first_tick=self._simulation.tick,
            ticks=NodeSettings.of(self._values).push_ticks,
        )

    def step(self, effort: FloatArray | Sequence[float]) -> StampedState:
        """Apply an effort (n,) for one tick, clipped to its limits; the state that follows.

        Raises:
            ConfigurationError: the effort has another shape, is not of numbers, or drives a joint
                that mimics another.
            SimulationError: the state has diverged; the message names the degree of freedom.
            ClosedError: the simulation is closed.
        """
        self._simulation.check_open()
        effort = real_array("an effort", effort)
        if effort.shape != (self.character.layout.size,):
            raise ConfigurationError(
                f"an effort has shape {effort.shape}; it must be "
                f"({self.character.layout.size},), one entry a degree of freedom"
            )
        if not is_finite(effort):
            raise ConfigurationError("an effort has entries that are not finite")
        (one,) = self._simulation.characters
        if self.character.coupling:
            check_undriven(self.character, effort)
        if one.state.effort is None:
            self._hash.add(one.state)
        pushes = self._pushes.take(self._simulation.tick)
        wanted = effort if self._drives_all else np.where(one.commanded, effort, 0.0)
        self._simulation.step([wanted], [pushes])
        self._hash.add(one.state)
        return one.state

    def reset(self, start: StampedState | None = None) -> StampedState:
        """Begin a new episode, which equals a fresh world to the bit; its first state.

        `start` is where it begins, from now on; None: where the last one did.

        Raises:
            ConfigurationError: `start` has not one finite number a degree of freedom.
            ClosedError: the simulation is closed.
        """
        size = self.character.layout.size
        states = {} if start is None else {"": finite_state(start, size)}
        self._simulation.reset(states=states)
        self._pushes.clear()
        self._first_tick = self._simulation.tick
        return self.state

    @property
    def _kind(self) -> tuple[tuple[str, ...], SimulationSettings, tuple[str, ...]]:
        """What another simulation's snapshot must have in common with this one."""
        (own,) = self._simulation.characters
        names = (self.character.file.name, *self.character.layout.dof_names)
        return names, self.settings, own.setup.mass_factors

    def snapshot(self) -> SimulationSnapshot:
        """The present state and all that follows from it, for `restore`; takes 0.3 ms."""
        return SimulationSnapshot(
            self._kind[0],
            self._simulation.snapshot(),
            self._first_tick,
            self._pushes.pushes,
            self._hash.copy(),
        )

    def restore(self, snapshot: SimulationSnapshot) -> StampedState:
        """Go on from a snapshot, to the bit; the state in which it was taken.

        It may be that of another simulation of the same character and parameters, in another
        process as well. From a pickled snapshot
        `state_hash` goes on with the hash so far instead of the states.

        Raises:
            ConfigurationError: it is of another character, or other parameters.
        """
        world = snapshot.world
        if self._kind != (snapshot.character, world.settings, world.characters[0].mass_factors):
            raise ConfigurationError(
                f"the snapshot is of a simulation of {snapshot.character[0]} with its parameters, "
                f"this is one of {self.character.file.name}; both must be the same"
            )
        self._simulation.load_snapshot(snapshot.world)
        self._first_tick = snapshot.first_tick
        self._pushes.replace(snapshot.pushes)
        self._hash = snapshot.states.copy()
        return self.state


def run(
    character: str | PathLike[str] = "humanoid",
    duration: float = 10.0,
    *,
    output: str | PathLike[str],
    in_process: bool = False,
    composed: bool = False,
    overwrite: bool = False,
    simulator: Mapping[str, object] = _NOTHING,
    controller: Mapping[str, object] = _NOTHING,
    **reference: object,
) -> dict[str, object]:
    """Run simulator, controller and recorder, by default over topics; returns the figures.

    Args:
        character: Name of one that ships, or path of its YAML or URDF file.
        duration: Length in s.
        output: Directory of the results: bag, figures, parameters and logs (docs/runs.md).
        in_process: Run all nodes in this process, without ROS: the same messages, sooner.
        composed: Have simulator and controller as nodes of one process: the same, sooner.
        overwrite: Replace the results in `output`.
        simulator: Parameters of `sim_node`, by name.
        controller: Parameters of `controller_node`, by name.
        reference: The motion: `clip`, `keyframes` or `reference`; none: the rest pose.

    Raises:
        ActuatedCharactersError: a name or a value is wrong, or a node failed.
    """
    if in_process and composed:
        raise ConfigurationError("in_process has no other process; composed must be false")
    # A loop of one's own needs none of these, which are a tenth of what its first step takes.
    from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
    from actuated_characters.runs.execution import run_over_topics
    from actuated_characters.runs.in_process import run_in_process

    plan = make_plan(character, duration, reference, simulator, controller)
    directory = Path(output).absolute()
    prepare_directory(directory, overwrite=overwrite)
    if in_process:
        run_in_process(plan, directory)
    else:
        run_over_topics(plan, directory, write_bag=True, composed=composed)
    return read_metrics(directory)[0]


def simulator_values(
    character: Character, start: StampedState | None, given: Mapping[str, object]
) -> Values:
    """The parameters of a simulator of one character that drives all that has a motor.

    And the root of a floating base. `start` is where it begins; None: in its rest pose.

    Raises:
        ActuatedCharactersError: a name or a value is wrong.
    """
    character = placed(character, given)
    layout = character.layout
    begins = {} if start is None else as_values(finite_state(start, layout.size))
    drivable = ["root"] * layout.has_floating_base + layout.actuated_joint_names
    everything = {"commanded_joints": drivable, **begins, **given}
    return simulator_parameters.resolve_alone(character, everything)
