"""The motion of a timeline while it is edited: what is wanted of the character, no physics."""

from pathlib import Path

from actuated_characters.timeline.content import Content
from controller_node import parameters as controller_parameters
from controller_node.references.base import Reference
from controller_node.references.hold import HoldReference
from controller_node.references.timeline.file import make_timeline
from controller_node.references.timeline.motion import TimelineReference, timeline_motion
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.errors import ActuatedCharactersError


class Preview:
    """The reference of a timeline's newest content that can be played."""

    def __init__(self, character: Character, file: Path) -> None:
        self._character, self._file = character, file
        self._motion: Reference = HoldReference(character)
        self.end = 0.0
        """When the motion is over, s: at the last key, or once it stands after steering."""
        self.errors: tuple[str, ...] = ()
        """What cannot be played of the content, and why; or what cannot be reached."""

    def take(self, content: Content) -> None:
        """Show other content; what cannot be played leaves the motion as it is."""
        try:
            timeline = make_timeline(self._file, dict(content))
            own = dict(timeline.settings.get("controller_node", {}))
            given = {"character": timeline.character, "reference": "timeline", "timeline": "a.yaml"}
            values = controller_parameters.resolve_for(self._character, {**own, **given})
            motion = timeline_motion(self._character, values, timeline)
        except ActuatedCharactersError as error:
            self.errors = (str(error).removeprefix(f"{self._file}: "),)
            return
        assert isinstance(motion.reference, TimelineReference)
        self._motion, self.end = motion.reference, motion.reference.still
        self.errors = tuple(each.removeprefix(f"{self._file}: ") for each in motion.warnings)

    def at(self, time: float) -> GeneralizedPosition:
        """The pose at a time in s."""
        return self._motion.sample(time).configuration
