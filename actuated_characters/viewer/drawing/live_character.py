"""A drawn character of a simulator that runs."""

import viser

from actuated_characters.bags.rebuilding import Rebuilt
from actuated_characters.viewer.drawing.drawn_character import Bind, DrawnCharacter


class LiveCharacter(DrawnCharacter):
    """A drawn character, and what its simulator says of it and of its world."""

    def __init__(
        self, scene: viser.SceneApi, name: str, rebuilt: Rebuilt, bind: Bind, number: int
    ) -> None:
        """Add all nodes; see DrawnCharacter. Raises CharacterError if a mesh cannot be used."""
        limits = rebuilt.known.effort_limits
        super().__init__(scene, name, rebuilt.character, limits, bind, number)
        self.rebuilt = rebuilt

    def take(self, rebuilt: Rebuilt) -> bool:
        """Take another description if it looks alike; whether it does."""
        one, other = self.character, rebuilt.character
        if (one.links, one.layout.joints) != (other.links, other.layout.joints):
            return False
        self.rebuilt, self.effort_limits = rebuilt, rebuilt.known.effort_limits
        return True
