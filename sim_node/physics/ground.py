"""How high the ground is beneath a point, where it is more than a plane."""

from msgs_config.arrays import FloatArray
from msgs_config.character.model import UrdfOptions
from sim_node.physics.engine import make_world
from sim_node.physics.settings import WorldSettings


class Ground:
    """A terrain in a world of its own, in which nothing moves."""

    def __init__(self, terrain: UrdfOptions) -> None:
        """Load a terrain's URDF. Raises CharacterError if it cannot be loaded."""
        self._world = make_world(WorldSettings(ground=False, terrain=terrain))

    def heights_below(self, points: FloatArray) -> FloatArray:
        """Height z (r,) in m of the highest surface below each point (r, 3); 0 without one."""
        return self._world.heights_below(points)
