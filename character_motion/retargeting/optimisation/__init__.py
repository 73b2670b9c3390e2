"""Angles by Gauss-Newton: the goals, the bodies kept apart, and the banded least squares."""
