"""Simulator and controllers as the nodes of one process."""
