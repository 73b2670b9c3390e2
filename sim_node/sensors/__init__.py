"""Sensors of a real robot: what IMUs and force sensors read, with noise."""
