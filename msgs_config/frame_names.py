"""Names of coordinate frames that ROS agrees upon (REP 105)."""

WORLD = "world"
"""The frame of everything that is given in the world."""

BASE_FRAME = "base_link"
"""The frame that is fixed to a robot's base."""
