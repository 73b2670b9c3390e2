"""Shared by the sub-commands."""
