"""Tracking with joint torques alone, by looking ahead in a model of the world."""
