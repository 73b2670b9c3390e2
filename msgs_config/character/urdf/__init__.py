"""A URDF as ROS means it: checked, repaired, written for the engine and for viewers."""
