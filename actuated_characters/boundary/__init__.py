"""Boundaries: for each of many runs the least value of a push, or the like, with which it fails."""
