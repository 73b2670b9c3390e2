"""Trained policies: offsets to the tracking errors by a network, in constant time."""
