"""Bags that their writer never closed, made whole."""
