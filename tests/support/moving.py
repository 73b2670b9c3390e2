"""Characters in random poses over time, and where Bullet has their links."""

import numpy as np

from character_motion.export.trajectories import (
    CharacterTrajectory,
    LinkPoses,
    Trajectories,
)
from msgs_config.character.model import Character
from tests.support.physics import link_poses, random_state, still_world

RATE = 20.0
FRAMES = 4


def random_motion(whole: Character, seed: int = 5) -> tuple[Trajectories, LinkPoses]:
    """Random positions one after the other, and the links' frames that Bullet has there."""
    rng = np.random.default_rng(seed)
    positions = np.array([random_state(whole, rng)[0] for _ in range(FRAMES)])
    configurations = whole.layout.configuration(positions)
    trajectory = CharacterTrajectory(whole.name, whole, configurations)
    still, poses = np.zeros(whole.layout.size), []
    with still_world(whole) as world:
        for position in positions:
            world.body.set_state(position, still)
            poses.append(link_poses(world.body, whole))
    origins, turns = (np.array(part) for part in zip(*poses, strict=True))
    motion = Trajectories(np.arange(FRAMES) / RATE, RATE, (trajectory,))
    return motion, LinkPoses(origins, turns)
