"""Repeats a recorded run up to a tick, with the real nodes, and lets it go on otherwise."""
