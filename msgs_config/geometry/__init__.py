"""Geometry for both sides: the numbers between a message and the next state."""
