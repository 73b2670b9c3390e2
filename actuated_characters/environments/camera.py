"""Pictures of an environment: the character on its ground, with its reference as a ghost."""

from collections.abc import Sequence

import numpy as np

from actuated_characters.render.engine.camera_pose import CameraPose, Size, framing
from actuated_characters.render.engine.posed_characters import PosedCharacters
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from sim_node.physics.settings import WorldSettings


class FollowingCamera:
    """A camera that goes along the ground with a character's root."""

    def __init__(
        self,
        character: Character,
        world: WorldSettings,
        size: Size,
        positions: Sequence[FloatArray],
    ) -> None:
        """Make a view so wide that all of some positions (n,) fit into it.

        Raises:
            CharacterError: a file of the character or of the terrain cannot be drawn.
        """
        self._size = size
        self._posed = PosedCharacters([character])
        self._first = np.array(positions[:1])
        seen = np.array(positions)
        outline = self._posed.outline(seen, self._posed.ways(seen))
        self._view = framing(outline, size[0] / size[1], CameraPose())
        self._renderer = Renderer(character, ground=world.ground, terrain=world.terrain)

    def picture(self, position: FloatArray, desired: FloatArray) -> Picture:
        """The picture (h, w, 3) of a position (n,) and a desired one, message form."""
        way = self._posed.ways(np.concatenate((self._first, [position])))[1].tolist()
        frame = FrameSpec(position, view=self._view.moved(*way), ghost=desired)
        return self._renderer.picture(frame, self._size)
