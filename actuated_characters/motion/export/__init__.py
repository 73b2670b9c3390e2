"""Runs, bags and clips as files of other programs."""
