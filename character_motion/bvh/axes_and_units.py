"""What a BVH file leaves open: which axis is up, and the unit of length."""

AXES = ("x", "y", "z", "-x", "-y", "-z")
UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inches": 0.0254, "feet": 0.3048}
"""Length in m of the units that a file may be in."""
