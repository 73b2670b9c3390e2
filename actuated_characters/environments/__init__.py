"""Environments of Gymnasium (the extra `gymnasium`); importing this registers them."""

import gymnasium

TRACK = "actuated_characters/Track-v0"

gymnasium.register(TRACK, entry_point="actuated_characters.environments.track:TrackEnv")
