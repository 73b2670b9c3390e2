"""Sampling-based motion control: corrections with which a clip needs no root assistance."""
