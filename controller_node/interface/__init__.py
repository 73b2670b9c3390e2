"""The controller's ROS interface: subscribers and publishers."""
