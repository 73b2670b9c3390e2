"""References: the desired state as a function of time."""
