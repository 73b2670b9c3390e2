"""Recordings and poses as pictures, and as films."""
