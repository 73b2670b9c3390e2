"""Mesh files: found, checked, read as triangles."""
