"""Inputs that are planned before a run, and the files that carry them to who sends them."""
