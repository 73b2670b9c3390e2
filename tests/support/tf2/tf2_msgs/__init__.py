"""Stands in for ROS' package of this name, which the wheels have not; see `msg`."""
