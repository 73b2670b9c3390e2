"""A drawn character of a simulator that runs."""

import numpy as np
import viser

from actuated_characters.bags.rebuilding import Rebuilt
from actuated_characters.metrics.falls import reader_for
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.drawing.drawn_character import Bind, DrawnCharacter
from actuated_characters.viewer.drawing.name_tag import TAG_HEIGHT, NameTag
from actuated_characters.viewer.drawing.sample import CharacterSample
from msgs_config.arrays import FloatArray
from msgs_config.shared_parameters import NO_GROUND

_FEW = 6  # characters whose tags are of full size


class LiveCharacter(DrawnCharacter):
    """A drawn character, and what its simulator says of it and of its world."""

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        rebuilt: Rebuilt,
        bind: Bind,
        number: int,
        skin: GivenSkin | None = None,
    ) -> None:
        """Add all nodes; see DrawnCharacter.

        Raises:
            CharacterError: a mesh cannot be used.
            SkinError: `skin` does not fit.
        """
        limits = rebuilt.known.effort_limits
        super().__init__(scene, name, rebuilt.character, limits, bind, number, skin)
        self.rebuilt = rebuilt
        self._tag: NameTag | None = None
        if rebuilt.world.name:  # one of several
            can_fall = _weighs(rebuilt)
            reader = reader_for(rebuilt.character, rebuilt.world.terrain) if can_fall else None
            of_many = len(rebuilt.world.characters) > _FEW
            self._tag = NameTag(scene, self.marks.name, rebuilt.world.name, reader, of_many=of_many)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The corners (3,) of a box around it, m, world, with room for what stands above it.

        Whatever it is doing, there is room for its rest pose, too: it may get up.
        """
        low, high = super().bounds()
        if self.character.layout.has_floating_base:
            rest = self._poses(np.array(self.character.rest_position))
            at = np.append((self.root - rest[0][0])[:2], 0.0)
            lowest, highest = self._spheres(rest[0] + at, rest[1]).bounds(np.eye(3))
            low, high = np.minimum(low, lowest), np.maximum(high, highest)
        return low, high + (0.0 if self._tag is None else TAG_HEIGHT) * np.array((0.0, 0.0, 1.0))

    def draw(self, sample: CharacterSample) -> None:
        """Move everything to where it is now."""
        super().draw(sample)
        if self._tag is not None and sample.state is not None:
            self._tag.draw(sample.state, self.origins, sample.mode)

    def begin_episode(self) -> None:
        """Forget what stands above it of the episode before."""
        if self._tag is not None:
            self._tag.begin_episode()

    def take(self, rebuilt: Rebuilt) -> bool:
        """Take another description if it looks alike, in a world alike; whether it does."""
        if rebuilt.world != self.rebuilt.world or _weighs(rebuilt) != _weighs(self.rebuilt):
            return False
        one, other = self.character, rebuilt.character
        if (one.links, one.layout.joints) != (other.links, other.layout.joints):
            return False
        self.rebuilt, self.effort_limits = rebuilt, rebuilt.known.effort_limits
        return True


def _weighs(rebuilt: Rebuilt) -> bool:
    """Whether there is gravity in a character's world, and a ground to fall to."""
    parameters = rebuilt.known.parameters
    return bool(parameters.get("gravity", 1.0)) and parameters.get("terrain") != NO_GROUND
