"""The files that students begin with."""
