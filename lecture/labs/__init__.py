"""The exercises: stubs for students, and what grades their files by exact figures."""
