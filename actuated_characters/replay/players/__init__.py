"""Nodes that play a bag in the place of the simulator or of the controller."""
