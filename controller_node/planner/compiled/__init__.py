"""What the planner does hundred thousands of times a second, compiled as `msgs_config.compiled`."""
