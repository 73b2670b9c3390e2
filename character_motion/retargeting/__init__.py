"""Captured motion of any skeleton, made into motion of a character."""
