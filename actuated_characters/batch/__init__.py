"""Many worlds of one character each, simulated together."""
