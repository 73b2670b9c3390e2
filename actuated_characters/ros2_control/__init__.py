"""The bridge between a simulator in lockstep and a controller manager of ros2_control."""
