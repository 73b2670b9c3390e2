"""Environments of Gymnasium (the extra `gymnasium`); importing this registers them.

Raises ConfigurationError, with how to get it, where the extra is not installed.
"""

from msgs_config.runtime.extras import require_extra

require_extra("gymnasium", "actuated_characters.environments")

import gymnasium  # noqa: E402 - after the check

TRACK = "actuated_characters/Track-v0"

gymnasium.register(
    TRACK,
    entry_point="actuated_characters.environments.track:TrackEnv",
    vector_entry_point="actuated_characters.environments.track_vector:TrackVectorEnv",
)
