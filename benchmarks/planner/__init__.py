"""Measurements of planned motion."""

from benchmarks.support.needed import need

need("planned motion", "plan")
