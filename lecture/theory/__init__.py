"""Closed forms that studies are compared with."""
