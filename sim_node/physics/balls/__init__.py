"""Balls that are thrown: their queue, and how they fly up to a character."""
