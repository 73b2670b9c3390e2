"""Recorded runs in the browser: a time line, plots beside the scene, exports and forks."""
