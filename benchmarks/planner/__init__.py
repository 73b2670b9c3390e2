"""Measurements of planned motion."""
