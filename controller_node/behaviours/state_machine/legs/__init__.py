"""Legs: their angles for a place of the foot, the way of a swing foot, the feet that carry."""
