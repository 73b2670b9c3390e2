"""A reference that is steered: walking and running at commanded velocities."""
