"""What machines can do: trials in the simulator, their figures, and the search for parameters."""
