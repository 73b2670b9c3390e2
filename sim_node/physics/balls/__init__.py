"""Balls that are thrown: their bodies, their queue, and how they fly up to a character."""
