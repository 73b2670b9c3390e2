"""Scenes: worlds to watch and to touch, by name."""
