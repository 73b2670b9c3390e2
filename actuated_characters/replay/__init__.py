"""Recorded runs, simulated and controlled again."""
