"""The simulator's ROS interface: subscribers, publishers, services."""
