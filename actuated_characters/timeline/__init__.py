"""Timelines in memory and on disk: a file's content, edits of it, and takes of what it does."""
