"""The controller that parameters make: the one in force, and the one for the next episode."""

from dataclasses import dataclass

import numpy as np

from controller_node.behaviours.factory import make_motion
from controller_node.controller import Controller
from controller_node.files_read import files_read
from controller_node.ground import GroundSettings, known_terrain
from controller_node.parameters import (
    commanded_joints,
    describe_planner,
    make_controller,
    make_controller_settings,
)
from msgs_config.arrays import IntArray
from msgs_config.character.layout import ROOT
from msgs_config.character.model import Character
from msgs_config.digests import sha256_of
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.memory import MemoryFormat
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Parameter, Value, Values


@dataclass
class ControllerSetup:
    """A controller, and all else that its parameters' values make."""

    values: Values
    controller: Controller
    first_state: StampedState  # the state in which its reference begins
    drives_root: bool
    driven: IntArray  # the entries of the effort that it drives
    warnings: tuple[str, ...]
    keyframe_format: MemoryFormat
    files: dict[str, str]  # SHA-256 of those that were read, see `files_read`
    terrain: str  # what it knows to lie on the ground, see `known_terrain`


def make_setup(character: Character, values: Values) -> ControllerSetup:
    """The setup of the parameters' values.

    Raises:
        ActuatedCharactersError: a value is wrong, or a file or clip cannot be used.
    """
    motion = make_motion(character, values)
    controller = make_controller(character, motion.reference, values)
    joints = commanded_joints(character, values)
    return ControllerSetup(
        values=values,
        controller=controller,
        first_state=motion.first_state(),
        drives_root=ROOT in joints,
        driven=np.flatnonzero(character.layout.mask(joints)),
        warnings=(*motion.warnings, *describe_planner(character, values)),
        keyframe_format=MemoryFormat(*controller.parts),
        files={name: sha256_of(path) for name, path in files_read(character, values).items()},
        terrain=known_terrain(GroundSettings.of(values).terrain),
    )


class ControllerSetups:
    """Takes changed values: the live ones at once, the others with the next episode.

    A controller for the next episode is built when the values are checked, so that nothing is left
    that could be wrong with them then.
    """

    def __init__(self, character: Character, parameters: list[Parameter], values: Values) -> None:
        """Build the first one. Raises as `make_setup` does."""
        self.in_force = make_setup(character, values)
        self.upcoming: ControllerSetup | None = None
        self._checked: ControllerSetup | None = None  # built for values that are to be taken
        self._character = character
        self._at_resets = [each.name for each in parameters if each.at_reset]
        self._may_drive_root = self.in_force.drives_root

    def go_on(self, memory: bytes) -> None:
        """Go on as the controller in a keyframe would, which had the same parameters.

        Raises:
            RecordingError: it had others, or is none of a controller.
        """
        controller = self.in_force.keyframe_format.read(memory)
        if not isinstance(controller, Controller):
            raise RecordingError("a keyframe cannot be used: it is none of a controller")
        self.in_force.controller = controller

    def check(self, values: Values) -> ControllerSetup | None:
        """Check values; the controller of the next episode, None if it is the one in force.

        Raises:
            ActuatedCharactersError: they cannot be taken.
        """
        self.in_force.controller.check(make_controller_settings(self._character, self._now(values)))
        if self._coming(values) == self._coming(self.in_force.values):
            return None
        upcoming = self._find(values) or make_setup(self._character, values)
        if upcoming.drives_root and not self._may_drive_root:
            raise ConfigurationError(
                "the root cannot be driven, because it was not when this controller began, and "
                "sim_node's 'commanded_joints' lack it; set 'root_assistance' to false"
            )
        self._checked = upcoming
        upcoming.controller.check(make_controller_settings(self._character, values))
        return upcoming

    def take(self, values: Values) -> None:
        """Take values. Raises as `check` does."""
        self.upcoming, self._checked = self.check(values), None
        self._set(self.in_force, self._now(values))
        if self.upcoming is not None:
            self._set(self.upcoming, values)

    def _set(self, setup: ControllerSetup, values: Values) -> None:
        """Set live values; where there is no new one, nothing happens that a planner notices."""
        if values != setup.values:
            setup.values = values
            setup.controller.settings = make_controller_settings(self._character, values)

    def _find(self, values: Values) -> ControllerSetup | None:
        """What was built already for the next episode's values."""
        built = filter(None, (self.upcoming, self._checked))
        return next((b for b in built if self._coming(b.values) == self._coming(values)), None)

    def begin_episode(self) -> bool:
        """Go on with the controller of the next episode; whether it is another one."""
        if self.upcoming is None:
            return False
        self.in_force, self.upcoming = self.upcoming, None
        return True

    @property
    def first_state(self) -> StampedState:
        """The state in which the next episode's reference begins."""
        return (self.upcoming or self.in_force).first_state

    def _now(self, values: Values) -> Values:
        """Values of which those of the next episode are still those in force."""
        return Values(values | self._coming(self.in_force.values))

    def _coming(self, values: Values) -> dict[str, Value]:
        return {name: values[name] for name in self._at_resets}
