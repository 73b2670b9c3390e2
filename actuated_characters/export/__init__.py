"""Recordings and clips as files of other programs."""
