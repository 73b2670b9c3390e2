"""One figure on the page of a search, in its place, with a word over its head."""

import numpy as np
import viser

from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.drawing.drawn_character import DrawnCharacter
from actuated_characters.viewer.drawing.name_tag import TAG_HEIGHT
from actuated_characters.viewer.drawing.sample import CharacterSample
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.messages.state import StampedState

_ABOVE = 0.25  # m, from the highest link's frame to the word
_SHOWN = {"reference": True, "forces": False, "balance": False, "torques": False, "skin": True}


class Figure(DrawnCharacter):
    """A character that is drawn at positions, without forces."""

    def __init__(
        self, scene: viser.SceneApi, name: str, character: Character, skin: GivenSkin | None
    ) -> None:
        """Add all nodes; see DrawnCharacter."""
        super().__init__(scene, name, character, character.effort_limits(), skin=skin)
        self.shows = _SHOWN
        self.word = ""
        self._label = scene.add_label(f"{self.marks.name}/word", "", anchor="bottom-center")

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The corners (3,) of a box around it, m, world, with room for the word."""
        low, high = super().bounds()
        return low, high + np.array((0.0, 0.0, TAG_HEIGHT))

    def pose(
        self, position: FloatArray, offset: FloatArray, reference: FloatArray | None = None
    ) -> None:
        """Draw it at a position (n,), with a reference (n,), both moved over the ground by (2,)."""
        state = StampedState(0, _moved(position, offset), np.zeros_like(position), None)
        desired = None if reference is None else _moved(reference, offset)
        self.draw(CharacterSample(state, desired))
        self.show(shown=True)
        if self._label.text != self.word:
            self._label.text = self.word
        self._label.position = (0.0, 0.0, float(self.origins[:, 2].max()) + _ABOVE)


def _moved(position: FloatArray, offset: FloatArray) -> FloatArray:
    moved = position.copy()
    moved[:2] += offset
    return moved
