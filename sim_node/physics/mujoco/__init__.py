"""The engine MuJoCo: the one place of the simulator that knows it."""
