"""When a tick goes on: lockstep, real time, watchdog, flow control. Neither ROS nor engine."""
