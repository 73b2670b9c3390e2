"""Runs of simulator and controller: planned, started, measured, ended."""
